"""Fly the check, take its figures from the record, judge them, keep them for the days to come."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from calibration.measurement import Estimate
from onboard.manoeuvres import manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.diagnosis.busy import too_busy_for_poses
from perchhw.flight.course import CourseRequest, CourseResult, fly_uninterrupted
from perchhw.hover_check.expected import expected
from perchhw.hover_check.history import History
from perchhw.hover_check.judge import CheckedQuantity, LineVerdict, in_words, judge
from perchhw.hover_check.lag import motor_lag
from perchhw.hover_check.poses import sensing, stream
from perchhw.hover_check.thrust import hover_thrust
from perchhw.hover_check.vibration import RotorLine, vibration
from perchhw.hover_check.windows import CheckWindows
from perchhw.lab.setup import FlightSetup
from perchhw.record import RunRecord, new_run_folder, read_run
from perchhw.screen.display import Display

KIND = "attitude_doublets"
"""After the hover: what a hover alone excites is too little to tell lag and delay."""
TILT = 1.5
"""m/s2 sideways of the larger doublets: 9 deg."""
HEIGHT = 1.1
_BELOW_CEILING = 0.55


@dataclass(frozen=True, kw_only=True)
class HoverCheck:
    """What a check found.

    Attributes:
        lines: a line a quantity.
        rotors: where the rotors' lines are, M1 first.
        since: when the last check was that found nothing changed, or None.
        checks: how many of these are looked back on.
        record: of the flight.
        kept: file of this check.
        busy: how this computer was too busy for it, which then is none of the days to come; or None.
    """

    lines: tuple[CheckedQuantity, ...]
    rotors: tuple[RotorLine, ...]
    since: str | None
    checks: int
    record: Path
    kept: Path
    busy: str | None

    @property
    def same(self) -> bool:
        """Whether nothing has changed, and the vehicle file holds."""
        return all(line.verdict in (LineVerdict.SAME, LineVerdict.NOTE) for line in self.lines)

    @property
    def verdict(self) -> str:
        """In one sentence."""
        return in_words(self.lines, self.since)

    def json_shape(self) -> dict[str, Any]:
        """The JSON document, SI."""
        return {
            "schema": "perchhw.hover_check_result/1",
            "same": self.same,
            "verdict": self.verdict,
            "changed": [one.held.what for one in self.lines if one.verdict is LineVerdict.CHANGED],
            "off_file": [one.held.what for one in self.lines if one.verdict is LineVerdict.OFF_FILE],
            "checks_before": self.checks,
            "since": self.since,
            "busy": self.busy,
            "lines": self.lines,
            "rotors": self.rotors,
            "record": self.record,
            "kept": self.kept,
            "aborted_by": None,
        }


def fly_check(setup: FlightSetup, out: Path, seconds: float, display: Display) -> CourseResult:
    """Hover `seconds` over the start mark, tilt a little to all sides, land.

    Raises:
        PerchhwError, KeyboardInterrupt: as :func:`perchhw.flight.course.fly_uninterrupted`.
    """
    folder = new_run_folder(out, "check-hover")
    request = CourseRequest.of(setup, KIND, _parameters(setup, seconds), folder)
    return fly_uninterrupted(request, **display.shows(folder, "hover"))


def _parameters(setup: FlightSetup, seconds: float) -> dict[str, float]:
    height = min(HEIGHT, _BELOW_CEILING * setup.room.lowest_ceiling)
    parameters = {"seconds": seconds, "acceleration": TILT, "repeats": 1.0, "height": height}
    if setup.lab is not None:
        x, y, _ = setup.lab.start(setup.lab.drone(setup.drone)).pose
        parameters |= {"x": x, "y": y}
    return parameters


def examine_check(record: Path, setup: FlightSetup, out: Path, *, begins_anew: bool = False) -> HoverCheck:
    """Judge a check that was flown to its end, and keep it beside the records in `out`.

    Args:
        record: run folder of :func:`fly_check`.
        setup: what flew.
        out: folder of the records.
        begins_anew: hold it against the vehicle file alone, and the days to come against it.

    Raises:
        RecordTooShort: the record does not hold what is needed.
        HistoryError: an earlier check is damaged.
    """
    vehicle = load_vehicle(setup.vehicle, setup.legs)
    run = read_run(record)
    measured, rotors = measure(run, vehicle, setup.room)
    history = History.of(out, setup.drone, setup.mocap, vehicle)
    before = () if begins_anew else history.before()
    busy = too_busy_for_poses(run.info)
    lines = judge(measured, expected(vehicle), [one.values for one in before], busy)
    kept = history.keep(datetime.now(UTC), record, lines, begins_anew=begins_anew, busy=busy)
    return HoverCheck(
        lines=lines,
        rotors=rotors,
        since=before[-1].when if before else None,
        checks=len(before),
        record=record,
        kept=kept,
        busy=busy,
    )


def measure(
    run: RunRecord, vehicle: Vehicle, room: RoomGeometry
) -> tuple[Mapping[str, Estimate], tuple[RotorLine, ...]]:
    """What the record of a check says, by name of the held quantity; and the rotors' lines.

    Raises:
        RecordTooShort: it does not hold what is needed.
    """
    parameters = {name: float(value) for name, value in run.config["parameters"].items()}
    duration = manoeuvre(KIND).course(parameters, room).duration
    windows = CheckWindows.of(run, parameters["seconds"], duration)
    thrust = hover_thrust(windows, vehicle)
    shaken = vibration(windows, vehicle, thrust.each)
    poses, felt = stream(windows), sensing(windows)
    measured = {
        "thrust": thrust.thrust,
        "motor_lag": motor_lag(windows, vehicle),
        "battery_resistance": thrust.resistance,
        "vibration_gyro": shaken.gyro,
        "vibration_accelerometer": shaken.accelerometer,
        "mocap_rate": poses.rate,
        "mocap_missing": poses.missing,
        "mocap_longest_gap": poses.longest_gap,
        "mocap_age": poses.age,
        "mocap_jitter": poses.jitter,
        "mocap_latency": felt.delay,
    }
    for number, share in enumerate(thrust.shares, 1):
        measured[f"motor_{number}"] = share
    for axis, turn, bias in zip("xyz", felt.turn, felt.bias, strict=True):
        measured[f"mocap_turn_{axis}"], measured[f"gyro_bias_{axis}"] = turn, bias
    return measured, shaken.rotors
