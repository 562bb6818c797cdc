"""A test flight that came to its end: how near it kept to its course, and what its pack was left with."""

import numpy as np

from onboard.arrays import FloatArray
from onboard.manoeuvres import CourseError, manoeuvre
from onboard.record.run_record import RunRecord
from perchhw.diagnosis.finding import Cause, Diagnosis, Number
from perchhw.record.shapes import room_of
from perchhw.supervisor import Phase

ASTRAY_M = 0.6
"""m from the course, as the ladder to the first flight allows (docs/hardware.md)."""
_LOOK = (
    "nothing needs mending; perchhw gap find --data RUN --vehicle VEHICLE holds it against the vehicle file"
)
_ASIDE = "perchhw check hover tells what pulls it aside: thrust, motors, lag or motion capture"


def diagnose_test_flight(run: RunRecord) -> Diagnosis:
    """The finding of a flight without a policy that no rule ended."""
    kind = str(run.config["flight"])
    words, numbers = [f"{kind} flown to its end"], dict[str, Number]()
    if (away := _from_course(run, kind)) is not None:
        words.append(f"at most {100.0 * away:.0f} cm from its course")
        numbers["from_course_m"] = away
    if (lowest := _lowest_voltage(run)) is not None:
        words.append(f"the pack's voltage fell to {lowest:.2f} V")
        numbers["lowest_v"] = lowest
    astray = away is not None and away > ASTRAY_M
    return Diagnosis(Cause.FLOWN, "; ".join(words), _ASIDE if astray else _LOOK, numbers)


def _from_course(run: RunRecord, kind: str) -> float | None:
    """m between the poses and the course at its farthest; None where the record does not hold both."""
    room, poses = room_of(run.config), run.series.get("pose")
    begin = next((e["t"] for e in run.events if e.get("phase") == Phase.TEST_FLIGHT), None)
    if room is None or poses is None or begin is None:
        return None
    try:
        course = manoeuvre(kind).course(run.config.get("parameters") or {}, room)
    except CourseError:  # of another version, or damaged
        return None
    t = poses.t - float(begin)
    place: FloatArray = np.column_stack([poses.numbers(axis) for axis in "xyz"])
    seen = (t >= 0.0) & (t <= course.duration) & np.isfinite(place).all(axis=1)
    if not seen.any():
        return None
    wanted = np.column_stack([np.interp(t[seen], course.t, course.position[:, axis]) for axis in range(3)])
    return float(np.linalg.norm(place[seen] - wanted, axis=1).max())


def _lowest_voltage(run: RunRecord) -> float | None:
    power = run.series.get("power")
    if power is None or not np.isfinite(volts := power.numbers("vbat")).any():
        return None
    return float(np.nanmin(volts))
