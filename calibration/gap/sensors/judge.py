"""Name what is wrong with the sensors: the mean over flights is an effect, the rest is each flight's own."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.found_effect import FoundEffect, FoundParameter, Improvement
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.sensors.correction import align, best_values, correct_flight
from calibration.gap.sensors.flight_estimates import (
    FlightSensing,
    estimate_flights,
    pool_flights,
)
from calibration.gap.sensors.gyro_scale import gyro_scale
from calibration.gap.sensors.held_out import held_out_improvement
from calibration.gap.sensors.pooling import Pooled
from onboard.vehicle import Vehicle
from onboard.vehicle.effects import EFFECTS, EffectParameter

_LEAST_IMPROVEMENT = 0.001

_SAMPLED = {"pose_offset": 0.04}
"""By effect, share of its length that a component may be off by (95 %) beside chance, as attitudes are known
at the lines of a log alone: the one along b_z, of which turns tell least, was off by 0.7 to 2 %, once by 8 %,
where the truth is known (docs/gap_figures.md)."""


@dataclass(frozen=True)
class SensingFindings:
    """Everything found about the sensors.

    Attributes:
        effects: those that all flights share, the most certain first; their errors are on flights that the
            values applied there are not from.
        flights: estimates of each flight that could be judged.
        pooled: means over flights by effect, one per parameter (delay, or x, y, z).
        broken: flights that must not be used further.
        notes: what differs between flights, and what could not be judged, in words.
        unexplained: disagreements of gyro and tracking that no effect says, in words.
    """

    effects: tuple[FoundEffect, ...]
    flights: tuple[FlightSensing, ...]
    pooled: Mapping[str, tuple[Pooled, ...]]
    broken: tuple[NotUsed, ...]
    notes: tuple[str, ...]
    unexplained: tuple[str, ...]


def judge_sensing(records: Sequence[FlightRecord]) -> SensingFindings:
    """Judge the sensors of `records` from the redundancy of motion capture and inertial sensors.

    An effect is named when the mean over flights is significant (:attr:`Pooled.significant`), larger than of
    practical interest, within its bounds, and lowers the disagreement on flights of other shapes.
    """
    flights, broken = estimate_flights(records)
    pooled = pool_flights(flights)
    judged = {flight.name: flight for flight in flights}
    used = [record for record in records if record.name in judged]
    effects: list[FoundEffect] = []
    notes = list(_remarks(pooled))
    standing_out = {name: means for name, means in pooled.items() if _stands_out(name, means)}
    for name in sorted(standing_out, key=lambda n: -max(abs(p.mean) / p.error for p in standing_out[n])):
        if not _within_bounds(name, pooled[name]):
            notes.append(f"{name} {_words(name, pooled[name])} is beyond its physical bounds: not named")
            continue
        gain = held_out_improvement(name, used, [judged[r.name] for r in used])
        if gain is not None and _helps(gain):
            effects.append(_effect(name, pooled[name], gain))
        else:
            notes.append(f"{name} {_words(name, pooled[name])} does not help on other flights: not named")
    aligned = [align(one, judged[one.name], best_values(judged[one.name], pooled)) for one in used]
    return SensingFindings(tuple(effects), flights, pooled, broken, tuple(notes), gyro_scale(aligned))


def apply_sensing(records: Sequence[FlightRecord], findings: SensingFindings) -> tuple[FlightRecord, ...]:
    """The records as ideal sensors would have given them.

    Flights with a broken clock are left out; those whose pose is the onboard estimate stay as they are.
    """
    judged = {flight.name: flight for flight in findings.flights}
    broken = {flight.name for flight in findings.broken}
    return tuple(
        correct_flight(record, judged[record.name], findings.pooled) if record.name in judged else record
        for record in records
        if record.name not in broken
    )


def unsaid(effects: Sequence[FoundEffect], vehicle: Vehicle) -> tuple[FoundEffect, ...]:
    """Those effects that the vehicle file does not say yet: with another value, or not at all."""
    filed = {effect.name: effect.values() for effect in vehicle.effects}
    return tuple(one for one in effects if one.name not in filed or not _says(filed[one.name], one))


def _says(values: Mapping[str, float], effect: FoundEffect) -> bool:
    """Whether each value is within the interval that was found, or next to it."""
    rules = EFFECTS[effect.name].parameters
    return all(
        one.ci95[0] - rules[key].practical_minimum
        <= values[key]
        <= one.ci95[1] + rules[key].practical_minimum
        for key, one in effect.parameters.items()
    )


def _effect(name: str, pooled: Sequence[Pooled], gain: Improvement) -> FoundEffect:
    return FoundEffect(
        name=name,
        parameters={
            key: FoundParameter(value=p.mean, unit=rule.unit, ci95=_with_doubt(p, name, pooled))
            for key, rule, p in _parameters(name, pooled)
        },
        **vars(gain),
    )


def _parameters(name: str, pooled: Sequence[Pooled]) -> Iterator[tuple[str, EffectParameter, Pooled]]:
    """Each parameter of an effect by name, what is known of it, and its mean."""
    rules = EFFECTS[name].parameters
    yield from zip(rules, rules.values(), pooled, strict=True)


def _with_doubt(one: Pooled, name: str, all_axes: Sequence[Pooled]) -> tuple[float, float]:
    """The interval of a mean, with what it may be off by for another reason than chance."""
    low, high = one.interval
    doubt = _SAMPLED.get(name, 0.0) * float(np.linalg.norm([p.mean for p in all_axes]))
    reach = math.hypot(0.5 * (high - low), doubt)
    return one.mean - reach, one.mean + reach


def _least(name: str) -> float:
    return max(parameter.practical_minimum for parameter in EFFECTS[name].parameters.values())


def _stands_out(name: str, pooled: Sequence[Pooled]) -> bool:
    return float(np.linalg.norm([p.mean for p in pooled if p.significant])) > _least(name)


def _within_bounds(name: str, pooled: Sequence[Pooled]) -> bool:
    return all(rule.low <= p.mean <= rule.high for _, rule, p in _parameters(name, pooled))


def _helps(gain: Improvement) -> bool:
    return (
        gain.improvement_ci95[0] > 0.0 and gain.error_after < (1.0 - _LEAST_IMPROVEMENT) * gain.error_before
    )


def _remarks(pooled: Mapping[str, Sequence[Pooled]]) -> Iterator[str]:
    """What flights do not share, and what may be there but is not certain."""
    for name, means in pooled.items():
        if max(p.spread for p in means) > _least(name):
            spreads = [f"{key} by {p.spread:.2g} {rule.unit}" for key, rule, p in _parameters(name, means)]
            yield f"{name} differs from flight to flight: {', '.join(spreads)}; corrected in each"
        if not _stands_out(name, means) and np.linalg.norm([p.mean for p in means]) > _least(name):
            yield f"{name} {_words(name, means)} is not certain: not named"


def _words(name: str, pooled: Sequence[Pooled]) -> str:
    parts = [f"{key} {p.mean:.4g} +- {p.error:.2g} {rule.unit}" for key, rule, p in _parameters(name, pooled)]
    return f"({', '.join(parts)})"
