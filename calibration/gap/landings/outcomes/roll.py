"""Why does the measured roll rate grow in a flip? Candidates, and what else each of them would do.

Both front motors flip; the gyro shows roll beside the pitch, in every flip alike. What could do that has
other consequences: a product of inertia yaws a body that pitches quickly, dwz/dt = I_xy (wy^2 - wx^2) / I_zz;
front motors of unequal thrust yaw it by their reaction torques, and in hover, where the same motors are
unequal, the controller tells them apart for good; so it does with a centre of mass to one side. What only
happens at full flip cannot be there in an approach, where small commanded pitch moments show the same share
of roll or not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from calibration.gap.landings.outcomes.starts import TriggerStart
from calibration.gap.landings.segments import commanded_thrusts
from calibration.measurement import drawn_again
from onboard.arrays import FloatArray, IntArray
from onboard.vehicle import Vehicle

LEAST_FLIPS = 5
REFUTED = 3.0
"""Standard errors between what a candidate would do and what was measured, at least; of few flips more."""

REFUTED_LEVEL = 0.01
"""Two-sided probability of Student's t that a refutation has at most: 4.6 standard errors of 5 flips."""

GYRO_TILT = 0.0175
"""rad: a gyro is square to the board to a degree at best; so much of the pitch rate may look like yaw."""

_SLOW = 1.0  # rad/s about b_y, below which a flip has not begun
_LAG = 0.1  # s, of motors in an approach, between up and down
_APPROACH = (2.5, 0.1)  # s before the trigger
_STRETCH, _EVERY, _FINE = 0.1, 0.02, 0.002  # s: increments of the rate, their distance, integration
_REPLICATES = 4000  # with 200 the standard error would hang on the seed by a tenth

Measured = tuple[float, float]
"""Value and standard error."""


@dataclass(frozen=True)
class RollCause:
    """One candidate.

    Attributes:
        name: of the effect.
        value: that explains the roll of the flips, in `unit`.
        predicted: what it would do besides, by measured quantity.
        refuted_by: quantities that contradict it.
    """

    name: str
    value: float
    unit: str
    predicted: dict[str, float]
    refuted_by: tuple[str, ...]


@dataclass(frozen=True)
class RollEvidence:
    """What flips and approaches say.

    Attributes:
        flips: how many.
        refuted_beyond: standard errors that refute.
        measured: value and standard error of the mean, by quantity: ``roll_per_pitch``; ``yaw_rad_s``, gained
            in the flip; ``approach_roll_per_pitch``, of commanded pitch moments; ``hover_roll`` and
            ``hover_twist``, left less right and M2, M4 less M1, M3 over all, of commanded thrusts.
        causes: candidates.
    """

    flips: int
    refuted_beyond: float
    measured: dict[str, Measured]
    causes: tuple[RollCause, ...]

    @property
    def left(self) -> tuple[str, ...]:
        """Candidates that nothing refutes."""
        return tuple(cause.name for cause in self.causes if not cause.refuted_by)

    def json_shape(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "flips": self.flips,
            "refuted_beyond_standard_errors": self.refuted_beyond,
            "measured": {name: {"value": v, "standard_error": s} for name, (v, s) in self.measured.items()},
            "causes": self.causes,
            "not_refuted": self.left,
        }


def roll_evidence(
    starts: Sequence[TriggerStart], vehicle: Vehicle, rng: np.random.Generator
) -> RollEvidence | None:
    """Hold the candidates against flips and approaches; None with fewer than LEAST_FLIPS flips."""
    flips = [flip for flip in map(_flip, starts) if flip is not None]
    if len(flips) < LEAST_FLIPS:
        return None
    body = vehicle.body
    ix, iy, iz = (one.value for one in (body.inertia_xx, body.inertia_yy, body.inertia_zz))
    gained, squared, mixed = (np.array(column) for column in zip(*flips, strict=True))
    ratio = _mean(gained[:, 0] / gained[:, 1])
    coupling = float(np.mean(mixed)) * (ix - iy) / iz
    measured = {"roll_per_pitch": ratio, "yaw_rad_s": _mean(gained[:, 2]), **_hover(starts, vehicle)}
    approach = _approach(starts, vehicle, rng)
    if approach is not None:
        measured["approach_roll_per_pitch"] = approach
    doubt = {"yaw_rad_s": GYRO_TILT * float(np.mean(np.abs(gained[:, 1])))}
    roll, share = float(np.mean(gained[:, 0])), ratio[0]
    torque_length, arm_x, arm_y = (
        one.value for one in (vehicle.motors.thrust_to_torque, body.arm_x, body.arm_y)
    )
    # M4 stronger and M1 weaker by a share e roll by -e arm_y / arm_x of the pitch moment (onboard.mixer).
    uneven = -share * (ix / iy) * (arm_x / arm_y)
    alike = {"approach_roll_per_pitch": share}
    reaction = roll * (torque_length / iz) / (arm_y / ix)
    candidates = (
        (
            "inertia_products",
            -share * ix,
            "kg m2",
            {"yaw_rad_s": coupling - share * ix * float(np.mean(squared)) / iz, **alike},
        ),
        ("com_offset", -uneven * arm_y, "m", {"yaw_rad_s": coupling, "hover_roll": -uneven, **alike}),
        (
            "motor_imbalance",
            uneven,
            "1",
            {"yaw_rad_s": coupling + reaction, "hover_twist": -uneven, **alike},
        ),
        (
            "motors unequal in the flip alone",
            uneven,
            "1",
            {"yaw_rad_s": coupling + reaction, "approach_roll_per_pitch": 0.0},
        ),
        ("gyro turned against the propellers", float(np.arctan(share)), "rad", {"yaw_rad_s": 0.0, **alike}),
    )
    beyond = max(REFUTED, float(stats.t.isf(0.5 * REFUTED_LEVEL, len(flips) - 1)))
    causes = tuple(
        RollCause(name, value, unit, predicted, _contradicted(predicted, measured, doubt, beyond))
        for name, value, unit, predicted in candidates
    )
    return RollEvidence(len(flips), beyond, measured, causes)


def _contradicted(
    predicted: dict[str, float], measured: dict[str, Measured], doubt: dict[str, float], beyond: float
) -> tuple[str, ...]:
    return tuple(
        name
        for name, value in predicted.items()
        if name in measured
        and abs(value - measured[name][0]) > beyond * np.hypot(measured[name][1], doubt.get(name, 0.0))
    )


def _flip(start: TriggerStart) -> tuple[FloatArray, float, float] | None:
    """Gained rates (3,), integral of wy^2 - wx^2 and of wx wy over a flip, to the last sample but one.

    The last one may have touched.
    """
    end = np.inf if start.contact is None else start.contact - start.contact_error + 1e-6
    rows = np.flatnonzero((start.gyro_t <= end) & (np.abs(start.gyro[:, 1]) > _SLOW))[:-1]
    if start.contact is None or rows.size < 3:
        return None
    t, w = start.gyro_t[rows], start.gyro[rows]
    squared = np.trapezoid(w[:, 1] ** 2 - w[:, 0] ** 2, t)
    return w[-1] - w[0], float(squared), float(np.trapezoid(w[:, 0] * w[:, 1], t))


def _hover(starts: Sequence[TriggerStart], vehicle: Vehicle) -> dict[str, Measured]:
    """Commanded thrusts before the trigger: left less right, and M2, M4 less M1, M3, over all."""
    rows = []
    for start in starts:
        found = _commands(start, vehicle)
        if found is not None:
            m1, m2, m3, m4 = found[1].mean(axis=0)
            rows.append([m3 + m4 - m1 - m2, m2 + m4 - m1 - m3] / (m1 + m2 + m3 + m4))
    if len(rows) < LEAST_FLIPS:
        return {}
    side, twist = np.array(rows).T
    return {"hover_roll": _mean(side), "hover_twist": _mean(twist)}


def _commands(start: TriggerStart, vehicle: Vehicle) -> tuple[FloatArray, FloatArray] | None:
    """Commanded thrusts (s before the trigger as negative times; N) of an approach."""
    commands = commanded_thrusts(start.flight, vehicle)
    if commands is None or start.flight.trigger is None:
        return None
    t, thrust = commands[0] - start.flight.trigger.t, commands[1]
    rows = (t > -_APPROACH[0]) & (t < -_APPROACH[1]) & (thrust.min(axis=1) > 0.0)
    return (t[rows], thrust[rows]) if np.count_nonzero(rows) > 10 else None


def _approach(starts: Sequence[TriggerStart], vehicle: Vehicle, rng: np.random.Generator) -> Measured | None:
    """Roll acceleration per pitch acceleration that commanded pitch moments make in approaches.

    Increments of both rates over 0.1 s are explained by the integrals of commanded roll and pitch moments
    behind the motors' lag, of the rates themselves, and a constant; flights are drawn again for the error.
    """
    blocks = [block for block in (_increments(start, vehicle) for start in starts) if block is not None]
    if len(blocks) < LEAST_FLIPS:
        return None

    normal = np.array([causes.T @ causes for causes, _ in blocks])
    explained = np.array([causes.T @ gained for causes, gained in blocks])

    def ratio(chosen: IntArray) -> float:
        found = np.linalg.lstsq(normal[chosen].sum(axis=0), explained[chosen].sum(axis=0), rcond=None)[0]
        return float(found[1, 0] / found[1, 1])

    again = [ratio(chosen) for chosen in drawn_again(len(blocks), _REPLICATES, rng)]
    return ratio(np.arange(len(blocks))), float(np.std(again))


def _increments(start: TriggerStart, vehicle: Vehicle) -> tuple[FloatArray, FloatArray] | None:
    """Explaining integrals (k, 5) and gained rates (k, 2) of an approach."""
    commands = _commands(start, vehicle)
    if commands is None:
        return None
    t, thrust = commands
    gyro_t, gyro = start.flight.series("gx", "gy")
    gyro_t = gyro_t - (start.flight.trigger.t if start.flight.trigger else 0.0)
    fine = np.arange(t[0], t[-1], _FINE)
    if fine.size * _FINE < 3.0 * _STRETCH:
        return None
    body = vehicle.body
    m1, m2, m3, m4 = thrust.T
    moments = np.column_stack(
        [
            body.arm_y.value * (m3 + m4 - m1 - m2) / body.inertia_xx.value,
            body.arm_x.value * (m2 + m3 - m1 - m4) / body.inertia_yy.value,
        ]
    )
    told = np.column_stack([np.interp(fine, t, moments[:, axis]) for axis in range(2)])
    lagged = np.empty_like(told)
    lagged[0] = told[0]
    for row in range(1, fine.size):
        lagged[row] = lagged[row - 1] + (_FINE / _LAG) * (told[row] - lagged[row - 1])
    rates = np.column_stack([np.interp(fine, gyro_t, gyro[:, axis]) for axis in range(2)])
    stretch, every = round(_STRETCH / _FINE), round(_EVERY / _FINE)
    sums = _FINE * np.cumsum(np.hstack([lagged, rates, np.ones((fine.size, 1))]), axis=0)
    return (sums[stretch:] - sums[:-stretch])[::every], (rates[stretch:] - rates[:-stretch])[::every]


def _mean(values: FloatArray) -> Measured:
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(values.size))
