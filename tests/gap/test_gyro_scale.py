"""A gyro that shows too much is told from tracked attitudes, before any model of the vehicle."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.gap.data.record import FlightRecord
from calibration.gap.sensors import judge_sensing
from calibration.gap.sensors.gyro_scale import gyro_scale


def turning(scale: float, seed: int) -> FlightRecord:
    """A flight of 30 s that turns about all axes, whose gyro shows `scale` times as much about b_y."""
    rng = np.random.default_rng(seed)
    t = np.arange(3000) * 0.01
    phase = rng.uniform(0.0, 6.0, 3)
    true = Rotation.from_rotvec(0.3 * np.sin(t[:, None] * [2.0, 2.6, 1.4] + phase))
    between = (true[:-1].inv() * true[1:]).as_rotvec() / 0.01
    rate = 0.5 * (np.vstack([between[:1], between]) + np.vstack([between, between[-1:]]))
    always, zeros = np.ones(t.size, dtype=np.bool_), np.zeros((t.size, 3))
    return FlightRecord(
        name=f"flight {seed}",
        source=Path("made"),
        shape="turns",
        t=t,
        position=zeros,
        velocity=zeros,
        attitude=(true * Rotation.from_rotvec(0.002 * rng.standard_normal((t.size, 3)))).as_quat(),
        rate=rate * [1.0, scale, 1.0] + 0.01 * rng.standard_normal(rate.shape),
        specific_force=None,
        duty=np.full((t.size, 4), 0.5),
        voltage=None,
        flying=always,
        motors_known=always,
        pose_known=always,
        inertial_known=always,
        resting=~always,
    )


@pytest.mark.parametrize(("scale", "said"), [(1.0, 0), (1.01, 0), (1.05, 1), (0.95, 1)])
def test_a_gyro_that_shows_too_much_is_said(scale: float, said: int) -> None:
    sentences = gyro_scale([turning(scale, seed) for seed in range(3)])
    assert len(sentences) == said
    assert all("b_y" in sentence for sentence in sentences)


def test_a_set_whose_gyro_shows_too_much_is_no_agreement() -> None:
    """Whatever the model of the vehicle says of it."""
    findings = judge_sensing([turning(1.05, seed) for seed in range(4)])
    (sentence,) = findings.unexplained
    assert "about b_y than the tracked body turns" in sentence
