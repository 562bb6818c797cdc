"""What is a radio gap in a log, and what only looks straight because it is logged often."""

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.gap.data.radio import received
from calibration.gap.data.samples import Samples

RESOLUTION = 2.0
"""PWM counts."""


def commands(hertz: float, noise: float = 0.0) -> Samples:
    """Whole counts of four motors that a quiet pilot moves once in two seconds, 10 s long."""
    t = np.arange(round(10.0 * hertz)) / hertz
    swing = 1500.0 * np.sin(np.pi * t[:, None] + np.arange(4.0))
    rough = noise * np.random.default_rng(1).standard_normal(swing.shape)
    return Samples(t, np.round(30000.0 + swing + rough))


def with_gap(given: Samples, begin: float, end: float) -> tuple[Samples, NDArray[np.bool_]]:
    """The samples between two times (s) on the line that a lost packet leaves, in whole counts."""
    inside = (given.t > begin) & (given.t < end)
    edges = np.flatnonzero(~inside)
    values = given.values.copy()
    for column in values.T:
        column[inside] = np.round(np.interp(given.t[inside], given.t[edges], column[edges]))
    return Samples(given.t, values), inside


@pytest.mark.parametrize("hertz", [100.0, 200.0, 500.0, 1000.0])
def test_smooth_commands_that_are_logged_often_are_no_gap(hertz: float) -> None:
    given = commands(hertz)
    done = received(given, RESOLUTION)
    assert done.samples.t.size == given.t.size
    assert (done.lost_s, done.dead_s) == (0.0, 0.0)


@pytest.mark.parametrize("hertz", [100.0, 500.0])
@pytest.mark.parametrize("noise", [0.0, 200.0])
def test_a_gap_is_found_at_every_rate(hertz: float, noise: float) -> None:
    given, inside = with_gap(commands(hertz, noise), 4.0, 4.2)
    done = received(given, RESOLUTION)
    gone = ~np.isin(given.t, done.samples.t)
    # A command that goes on almost as the line went belongs to the gap for a sample or two.
    assert np.count_nonzero(gone & ~inside) <= 4 * hertz / 100.0
    assert np.count_nonzero(inside & ~gone) <= 4 * hertz / 100.0
    assert done.lost_s == pytest.approx(0.2, abs=0.04)


def test_a_link_that_is_lost_leaves_a_line_to_the_end() -> None:
    given, _ = with_gap(commands(500.0, 200.0), 6.0, 20.0)
    done = received(given, RESOLUTION)
    assert done.dead_s == pytest.approx(4.0, abs=0.01)
    assert done.samples.t[-1] <= 6.0


@pytest.mark.parametrize("step", [65535.0 / 255.0, 65535.0 / 100.0, 65535.0 / 2000.0])
@pytest.mark.parametrize("hertz", [100.0, 500.0])
def test_commands_in_coarse_steps_stand_still_and_are_no_gap(hertz: float, step: float) -> None:
    """Bytes, percent and DShot's 2000 steps, brought to 0..65535 as docs/gap_data.md asks for."""
    given = commands(hertz)
    stepped = Samples(given.t, np.round(np.round(given.values / step) * step))
    done = received(stepped, RESOLUTION, may_stand=True)
    assert (done.samples.t.size, done.lost_s) == (given.t.size, 0.0)
    broken, inside = with_gap(stepped, 4.0, 4.4)
    done = received(broken, RESOLUTION, may_stand=True)
    gone = ~np.isin(given.t, done.samples.t)
    sloped = np.any(np.abs(np.diff(broken.values, axis=0, prepend=broken.values[:1])) > 0.0, axis=1) & inside
    assert not np.any(gone & ~inside)
    assert np.count_nonzero(gone & sloped) >= 0.7 * np.count_nonzero(sloped)


def test_commands_in_fine_steps_that_stand_still_were_held() -> None:
    given = commands(100.0, 200.0)
    held = given.values.copy()
    held[400:420] = held[400]
    assert received(Samples(given.t, held), RESOLUTION, may_stand=True).lost_s == pytest.approx(0.2, abs=0.04)
