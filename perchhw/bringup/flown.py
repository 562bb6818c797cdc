"""What a test flight's record says about the drone, held against its course and its vehicle file."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO, thrust_from_voltage
from onboard.gravity import GRAVITY
from onboard.manoeuvres import Course
from onboard.vehicle import Vehicle
from perchhw.doctor.check_result import CheckResult, judged
from perchhw.record import RunRecord

THRUST = 0.15
"""Of the weight: between the thrust that the vehicle file gives the commands, and what holds the drone."""
IMBALANCE = 0.25
"""Of the mean: between the strongest and the weakest motor of a hover."""
VIBRATION = 2.0
"""m/s2 rms about the mean, after the firmware's 30 Hz filter. Ours, until a lab's hovers say better."""
HOLD = 0.15
"""m, farthest from the place of the hover."""
ASTRAY = 0.6
"""m, farthest from the course: as far as the corridor of an approach is wide."""
LEVELLED = 0.2
"""m from the end of the course, in its last half second."""
_MOTORS: Final = ("m1", "m2", "m3", "m4")


@dataclass(frozen=True)
class CourseWindow:
    """The part of a record in which the course was flown: t from `begin` to `end` (s)."""

    run: RunRecord
    begin: float
    end: float

    @classmethod
    def of(cls, run: RunRecord, course: Course) -> "CourseWindow":
        """From the start of the course on."""
        begin = next(e["t"] for e in run.events if e["event"] == "phase" and e["phase"] == "test flight")
        return cls(run, begin, begin + course.duration)

    def columns(self, topic: str, *names: str) -> tuple[FloatArray, FloatArray]:
        """Times (n,) and values (n, len(names)) of the rows that have all of them."""
        series = self.run.series[topic]
        values = np.column_stack([series.numbers(name) for name in names])
        rows = (series.t >= self.begin) & (series.t <= self.end) & np.isfinite(values).all(axis=1)
        return series.t[rows], values[rows]


def hover_findings(window: CourseWindow, course: Course, vehicle: Vehicle) -> tuple[CheckResult, ...]:
    """Place, thrust, imbalance and vibration of a hover."""
    _, voltage = window.columns("power", "vbat")
    _, pwm = window.columns("motors", *_MOTORS)
    thrust_map = vehicle.motors.thrust_map_compiled()
    volts = pwm.mean(axis=0) / FULL_RATIO * float(voltage.mean())
    thrusts = np.array([thrust_from_voltage(thrust_map, float(v)) for v in volts])
    weight = vehicle.body.mass.value * GRAVITY
    off = float(thrusts.sum()) / weight - 1.0
    spread = float(np.ptp(thrusts) / thrusts.mean())
    _, acceleration = window.columns("acceleration", "ax", "ay", "az")
    vibration = float(np.sqrt(acceleration.var(axis=0).sum()))
    each = ", ".join(f"M{i + 1} {1e3 * thrust:.0f} mN" for i, thrust in enumerate(thrusts))
    return (
        _near(window, course, "hold", HOLD, 0.0),
        judged(
            "thrust",
            abs(off) <= THRUST,
            f"{100.0 * off:+.0f} % of the weight",
            f"within {100.0 * THRUST:.0f} %",
            "mass or thrust map of the vehicle file are not this drone's: landings flip too hard or too soft",
            "weigh the drone with its battery; a full pack, sound propellers; perchhw calibrate thrust",
        ),
        judged(
            "imbalance",
            spread <= IMBALANCE,
            f"{100.0 * spread:.0f} % ({each})",
            f"at most {100.0 * IMBALANCE:.0f} %",
            "a motor that already works harder has nothing left for the flip",
            "centre battery and markers; exchange the propeller, then the motor, that differs",
        ),
        judged(
            "vibration",
            vibration <= VIBRATION,
            f"{vibration:.2f} m/s2 rms",
            f"at most {VIBRATION:g} m/s2",
            "the estimator integrates it",
            "balance or exchange propellers; is everything glued on?",
        ),
    )


def step_findings(window: CourseWindow, course: Course) -> tuple[CheckResult, ...]:
    """How far from its course the drone was, and whether it came to rest."""
    return (
        _near(window, course, "on_course", ASTRAY, 0.0),
        _near(window, course, "levelled_out", LEVELLED, course.duration - 0.5),
    )


def _near(window: CourseWindow, course: Course, what: str, limit: float, since: float) -> CheckResult:
    """The farthest of the poses from the course, from `since` (s) of it on."""
    t, position = window.columns("pose", "x", "y", "z")
    t = t - window.begin
    wanted = np.column_stack([np.interp(t, course.t, course.position[:, axis]) for axis in range(3)])
    distances = np.linalg.norm(position - wanted, axis=1)[t >= since]
    farthest = float(distances.max()) if len(distances) else float("inf")
    return judged(
        what,
        farthest <= limit,
        f"{100.0 * farthest:.0f} cm",
        f"at most {100.0 * limit:.0f} cm",
        "an approach needs a drone that flies where it is told",
        "is the estimate steady (perchhw log view)? wind of an air conditioning? then gains and propellers",
    )
