"""Each flight's motion beside its simulated draws: what the page of landings draws and says of it."""

import base64
import io
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, flight_files, open_flights
from calibration.gap.landings.kernels import COLUMNS, OMEGA
from calibration.gap.landings.outcomes import (
    LandingReport,
    PreparedLandings,
    forecast,
    landing_report,
    prepare,
    read_labels,
)
from calibration.gap.landings.outcomes.differences import differences
from calibration.gap.landings.outcomes.kernels import fly_flips, follow_flips
from calibration.gap.landings.outcomes.labels import shares_of
from calibration.gap.landings.outcomes.measured_motion import BEFORE, MeasuredMotion, measured_motion
from calibration.gap.landings.outcomes.predict import scattered
from calibration.gap.landings.outcomes.prepare import SETTINGS
from calibration.gap.landings.outcomes.simulated_motion import (
    SimulatedMotion,
    flip_angles,
    simulated_motion,
)
from calibration.gap.report.landing_pictures import by_surprise, landing_pictures
from calibration.gap.report.landings_page import landings_page
from onboard.outcome import Outcome
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.rollout import ROLLOUT

VEHICLE = load_vehicle("crazyflie21-upgraded")
PARAMETERS = physics_parameters(VEHICLE, RoomGeometry())
DRAWS = 20
HORIZON = 0.8
NASTY = "<script>alert(1)</script>&\"'"


@pytest.fixture(scope="module")
def labels(shared_data: Path) -> dict[Path, Outcome]:
    return read_labels(flight_files([shared_data / "habas2022" / "flights"]))


@pytest.fixture(scope="module")
def flights(labels: dict[Path, Outcome]) -> list[Flight]:
    return [one for one in open_flights(sorted(labels)[::6])[0] if one.trigger is not None]


@pytest.fixture(scope="module")
def prepared(flights: list[Flight]) -> PreparedLandings:
    return prepare(flights, VEHICLE, np.random.default_rng(0), DRAWS)


def reported(prepared: PreparedLandings, labels: dict[Path, Outcome]) -> LandingReport:
    real = [labels[start.flight.source] for start in prepared.starts]
    found = forecast(prepared, PARAMETERS)
    return landing_report(prepared, found, real, [True] * len(real), VEHICLE, seed=0)


def cut_after(flight: Flight, end: float, *channels: str) -> Flight:
    """A flight whose channels (all: none named) are not known from `end` (s) after the trigger on."""
    assert flight.trigger is not None
    early = flight.t <= flight.trigger.t + end
    names = channels or tuple(flight.valid)
    return replace(flight, valid={**flight.valid, **{name: flight.valid[name] & early for name in names}})


def test_the_motion_is_that_of_the_draws_whose_ends_are_counted(prepared: PreparedLandings) -> None:
    """To the last bit: ends and last states, whether the motion that is kept ends before them or after."""
    p = PARAMETERS.copy()
    p["ceiling_z"] = prepared.ceilings[0]
    start, numbers = prepared.starts[0], prepared.draws[0]
    states, flips = scattered(start, prepared.dispersion, numbers, p)
    counted = np.zeros(DRAWS, dtype=ROLLOUT)
    fly_flips(states, p, flips, SETTINGS, counted)
    for horizon in (0.05, HORIZON, 3.0):
        moving = simulated_motion(prepared, 0, PARAMETERS, horizon)
        assert moving.ends.tobytes() == counted.tobytes()
        assert moving.traces.shape == (DRAWS, moving.t.size, COLUMNS)
        assert np.isfinite(moving.traces).all()
    expected = forecast(prepared, PARAMETERS).flights[0]
    np.testing.assert_array_equal(shares_of(moving.ends["feet"]), expected.probability)
    # Where a landing ends, its trace is where fly_flips left it.
    rows = np.rint(counted["duration"] / SETTINGS.dt).astype(int)
    ended = rows < moving.t.size
    assert ended.any()
    at_end = moving.rates[np.arange(DRAWS), np.minimum(rows, moving.t.size - 1)]
    np.testing.assert_array_equal(at_end[ended], states["omega"][ended])


def test_thrusts_stop_when_the_body_axis_is_horizontal(prepared: PreparedLandings) -> None:
    moving = simulated_motion(prepared, 0, PARAMETERS, HORIZON)
    running = moving.thrusts.max(axis=2) > 0.0
    angles = moving.flip_angles
    assert np.isfinite(moving.cuts).all()
    for draw in range(DRAWS):
        last = int(np.flatnonzero(running[draw])[-1])
        assert running[draw, : last + 1].all()
        assert np.degrees(angles[draw, last + 1]) == pytest.approx(90.0, abs=8.0)


def test_samples_are_the_files_own_at_the_log_s_times_moved_by_its_clock(
    prepared: PreparedLandings, flights: list[Flight]
) -> None:
    for index, (start, flip) in enumerate(zip(prepared.starts, prepared.flips, strict=True)):
        seen = measured_motion(prepared, index, VEHICLE, HORIZON)
        flight = start.flight
        assert flight.trigger is not None
        t, rates = flight.series("gx", "gy", "gz")
        for when, row in zip(seen.gyro_t, seen.gyro, strict=True):
            near = np.flatnonzero(np.abs(t - (when - flip.clock + flight.trigger.t)) < 1e-9)
            assert any(np.array_equal(rates[k][np.isfinite(row)], row[np.isfinite(row)]) for k in near)
        assert seen.gyro_t[0] >= -BEFORE
        assert seen.pose_t[-1] <= flip.clock + 1e-9  # an onboard estimate ends at the trigger
        told_t, told = flight.series("f1", "f2", "f3", "f4")
        rows = np.searchsorted(told_t, seen.thrust_t - flip.clock + flight.trigger.t - 1e-9)
        np.testing.assert_array_equal(seen.thrust, told[rows])


def test_flip_angles_count_the_nose_up_and_go_on_beyond_half_a_turn() -> None:
    turned = np.linspace(0.0, 1.5 * np.pi, 40)
    attitudes = np.zeros((40, 4))
    attitudes[:, 1], attitudes[:, 3] = np.sin(-0.5 * turned), np.cos(-0.5 * turned)  # about -b_y: nose up
    np.testing.assert_allclose(flip_angles(attitudes), turned, atol=1e-12)


def moved(simulated: SimulatedMotion, draw: int, later: float = 0.0, roll: float = 0.0) -> MeasuredMotion:
    """A perfect log of one draw, whose gyro sees a further roll rate, and whose contact is `later`."""
    rows = slice(0, simulated.t.size, 10)
    gyro = simulated.rates[draw, rows] + np.array([roll, 0.0, 0.0])
    contact = float(simulated.contacts[draw]) + later
    until = simulated.t <= contact
    return MeasuredMotion(
        0.0, True, contact, 0.005, simulated.t[rows], gyro, np.empty(0), np.empty((0, 7)), np.empty(0),
        np.empty((0, 4)), simulated.t[until], simulated.quaternions[draw, until], (),
    )  # fmt: skip


def test_only_what_was_made_to_differ_is_told_apart(prepared: PreparedLandings) -> None:
    simulated = simulated_motion(prepared, 0, PARAMETERS, HORIZON)
    median = np.nanmedian(simulated.contacts)
    draw = int(np.argmin(np.abs(simulated.contacts - median)))
    assert differences(moved(simulated, draw), simulated) == ()
    (late, *_) = differences(moved(simulated, draw, later=0.1), simulated)
    assert re.fullmatch(r"contact \d+ ms later", late.words)
    assert float(re.findall(r"\d+", late.words)[0]) == pytest.approx(100.0, abs=10.0)
    assert differences(replace(moved(simulated, draw, later=0.1), clock_known=False), simulated) == ()
    first = differences(moved(simulated, draw, roll=4.0), simulated)[0]
    assert first.words.startswith("roll rate +")
    assert first.t < 0.05


def test_gyro_at_its_range_is_left_out_and_said(prepared: PreparedLandings, flights: list[Flight]) -> None:
    start = prepared.starts[0]
    limit = VEHICLE.sensing.gyro_range.value
    rates = start.flight.data["gy"].copy()
    assert start.flight.trigger is not None
    row = int(np.searchsorted(start.flight.t, start.flight.trigger.t + 0.4))
    rates[row] = -limit
    clipped = replace(start, flight=replace(start.flight, data={**start.flight.data, "gy": rates}))
    changed = replace(prepared, starts=(clipped, *prepared.starts[1:]))
    seen = measured_motion(changed, 0, VEHICLE, HORIZON)
    assert np.count_nonzero(np.isnan(seen.gyro)) == 1
    assert any("1 sample of the gyro at its range" in words for words in seen.left_out)
    assert "poses after the trigger" in " ".join(seen.left_out)


@pytest.mark.slow
def test_the_page_of_flights_is_one_file_in_order_of_surprise(
    flights: list[Flight], labels: dict[Path, Outcome]
) -> None:
    """Also of a flight whose record or commands end early; drawn again it is the same; names are text."""
    short, mute, *others = flights
    named = replace(cut_after(mute, 0.0, "f1", "f2", "f3", "f4"), name=NASTY)
    few = prepare([cut_after(short, 0.25), named, others[0]], VEHICLE, np.random.default_rng(0), DRAWS)
    report = reported(few, labels)
    pictures = list(landing_pictures(report, PARAMETERS))
    order = [one.index for one in pictures]
    assert order == by_surprise(report)
    assert sorted(order) == list(range(len(few.starts)))
    text = landings_page(report, pictures)
    assert next(landing_pictures(report, PARAMETERS)) == pictures[0]
    assert "<script" not in text
    assert NASTY in unescape(text)
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    anchors = re.findall(r'<section id="([^"]*)">', text)
    assert [f"#{one}" for one in anchors] == [one for one in sources if one.startswith("#flight")]
    assert all(one.startswith(("data:image/png;base64,", "#")) for one in sources)
    images = re.findall(r'<img alt="([^"]+)" loading="lazy" src="data:image/png;base64,([^"]*)">', text)
    assert len(images) == len(few.starts)
    for alt, drawn in images:
        assert "expected were four" in alt
        assert io.BytesIO(base64.b64decode(drawn)).read(4) == b"\x89PNG"
    said = {one.name: one.left_out for one in pictures}
    assert "motor commands after the trigger (not logged)" in said[NASTY]
    assert "the record ends there" in said[few.starts[0].name]


def test_following_keeps_start_and_every_step(prepared: PreparedLandings) -> None:
    """A kept motion starts where its draw does."""
    states, flips = scattered(prepared.starts[0], prepared.dispersion, prepared.draws[0], PARAMETERS)
    traces, cuts = np.empty((DRAWS, 3, COLUMNS)), np.empty(DRAWS)
    rates = states["omega"].copy()
    follow_flips(states, PARAMETERS, flips, SETTINGS, traces, cuts, np.zeros(DRAWS, dtype=ROLLOUT))
    np.testing.assert_array_equal(traces[:, 0, OMEGA : OMEGA + 3], rates)
    assert np.all(traces[:, 1, OMEGA : OMEGA + 3] != rates)
