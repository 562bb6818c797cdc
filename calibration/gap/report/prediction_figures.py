"""What a report shows of predictions: the same flights predicted by one model after the other.

`stages` are :class:`~calibration.gap.replay.evaluation.PredictionErrors` of the same flights by name, in
the order of :class:`~calibration.gap.report.figures_data.ReportFigures`: before, after each effect, at last
with all of them.
"""

from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter

import numpy as np

from calibration.gap.replay.evaluation import ErrorPair, PredictionErrors
from calibration.gap.replay.flight_prediction import QUANTITIES, ByHorizon, HorizonErrors
from calibration.gap.report.document import Gap, Levels
from calibration.gap.report.figures_data import HorizonCurves, StageBars
from onboard.arrays import FloatArray
from onboard.vehicle.unnamed import UnnamedCurve

Stages = Mapping[str, PredictionErrors]

_UNITS = dict(zip(QUANTITIES, ("m", "m/s", "deg", "rad/s"), strict=True))
_WORDS = dict(zip(QUANTITIES, ("position", "velocity", "attitude", "rate"), strict=True))
HORIZON = 1.0
"""s, of the error that stands for the whole gap."""

_CHANNEL_HORIZON = 0.5
"""s: long against the noise, short against what one channel does to another."""
_GIVEN = "attitude given"
_METRIC = f"position, {_GIVEN}"
_CHANNELS = {
    **{f"force_{axis}": (f"velocity_{axis}_m_s", "m/s") for axis in "xyz"},
    **{f"torque_{axis}": (f"rate_{axis}_rad_s", "rad/s") for axis in "xyz"},
}
"""Channel by the prediction error that shows it, and its unit."""

_TORQUES = ("torque_x", "torque_y", "torque_z")


def prediction_gap(stages: Stages) -> Gap:
    """The gap of first and last stage: position after :data:`HORIZON` with given attitude, and all else.

    Where no flight reaches that far, the longest horizon that one does reach stands for it.

    Channels are velocity errors with given attitude ("force_x", m/s) and open-loop rate errors ("torque_x",
    rad/s) along the body axes after half a second.
    """
    first, last = _ends(stages)
    horizon = _within_reach(first, HORIZON)
    floor = first.floor
    one, other = first.overall, last.overall
    sensed = ErrorPair({}, {}) if floor is None else floor
    by_horizon = {
        str(h): _levels(errors, other.given_attitude[h], sensed.given_attitude.get(h), "position_m")
        for h, errors in one.given_attitude.items()
    }
    by_quantity = {
        **_by_quantity(f", {_GIVEN}", one.given_attitude, other.given_attitude, sensed.given_attitude),
        **_by_quantity(", all predicted", one.open_loop, other.open_loop, sensed.open_loop),
        **_by_quantity(", torque estimated", first.with_torque_estimate, last.with_torque_estimate, {}),
    }
    later, quiet = last.by_phase(), first.of_sensors.by_phase()
    return Gap(
        metric=f"position error after {horizon:g} s, {_GIVEN}",
        overall=by_horizon[str(horizon)],
        by_horizon=by_horizon,
        by_channel=_by_channel(first, last, _within_reach(first, _CHANNEL_HORIZON)),
        by_phase={
            name: _levels(
                pair.given_attitude[horizon],
                later[name].given_attitude[horizon],
                quiet[name].given_attitude.get(horizon) if name in quiet else None,
                "position_m",
            )
            for name, pair in first.by_phase().items()
            if horizon in pair.given_attitude and name in later and horizon in later[name].given_attitude
        },
        by_quantity=by_quantity,
    )


def acted_on(
    without: PredictionErrors, with_them: PredictionErrors, curves: Iterable[UnnamedCurve]
) -> list[Levels]:
    """Errors that curves without a name act on, without and with them: the position where they are forces,
    the rates about their axes where they are torques."""
    gap = prediction_gap({"before": without, "after": with_them})
    channels = {curve.channel for curve in curves}
    rates = [levels for channel, levels in gap.by_channel.items() if channel in channels & set(_TORQUES)]
    forces = [gap.overall] if channels - set(_TORQUES) else []
    return [*forces, *rates]


def horizon_curves(stages: Stages) -> tuple[HorizonCurves, ...]:
    """Position and velocity with given attitude, then attitude open loop, against the horizon."""
    first, _ = _ends(stages)
    floor = first.floor
    wanted: tuple[tuple[str, str, Callable[[ErrorPair], ByHorizon]], ...] = (
        ("position_m", f", {_GIVEN}", attrgetter("given_attitude")),
        ("velocity_m_s", f", {_GIVEN}", attrgetter("given_attitude")),
        ("attitude_deg", ", all predicted", attrgetter("open_loop")),
    )
    return tuple(
        HorizonCurves(
            quantity=_WORDS[quantity] + words,
            unit=_UNITS[quantity],
            horizons=np.array(first.horizons),
            stages={name: _curve(of(errors.overall), quantity, first) for name, errors in stages.items()},
            floor=None if floor is None else _curve(of(floor), quantity, first),
        )
        for quantity, words, of in wanted
    )


def phase_bars(stages: Stages) -> StageBars:
    """Position error with given attitude after :data:`HORIZON`, by phase of flight."""
    first, _ = _ends(stages)
    horizon = _within_reach(first, HORIZON)
    labels = tuple(name for name, pair in first.by_phase().items() if horizon in pair.given_attitude)

    def row(phases: Mapping[str, ErrorPair]) -> FloatArray:
        found = [phases[label].given_attitude.get(horizon) if label in phases else None for label in labels]
        return _floats([None if errors is None else errors.position_m for errors in found])

    rows = {name: row(errors.by_phase()) for name, errors in stages.items()}
    return StageBars(
        unit=f"m after {horizon:g} s",
        labels=labels,
        stages=rows,
        floor=row(first.of_sensors.by_phase()),
    )


def channel_bars(stages: Stages) -> StageBars:
    """Velocity errors (attitude given) and rate errors (open loop) by body axis, as shares of the first."""
    first, _ = _ends(stages)
    horizon = _within_reach(first, _CHANNEL_HORIZON)
    base = first.by_channel()[horizon]
    rows = {
        name: _floats([errors.by_channel()[horizon][key] / base[key] for key, _ in _CHANNELS.values()])
        for name, errors in stages.items()
    }
    quiet = first.of_sensors.by_channel().get(horizon, {})
    floor = [quiet[key] / base[key] if key in quiet else None for key, _ in _CHANNELS.values()]
    return StageBars(
        unit="share of before",
        labels=tuple(_CHANNELS),
        stages=rows,
        floor=_floats(floor),
    )


def _ends(stages: Stages) -> tuple[PredictionErrors, PredictionErrors]:
    every = list(stages.values())
    return every[0], every[-1]


def _within_reach(errors: PredictionErrors, horizon: float) -> float:
    """The longest horizon (s) up to the one asked for, or else the shortest, that a flight reaches."""
    reached = list(errors.overall.given_attitude)
    return max((h for h in reached if h <= horizon), default=reached[0])


def _levels(
    before: HorizonErrors, after: HorizonErrors, floor: HorizonErrors | None, quantity: str
) -> Levels:
    return Levels(
        before=getattr(before, quantity),
        after=getattr(after, quantity),
        noise_floor=None if floor is None else getattr(floor, quantity),
        unit=_UNITS[quantity],
    )


def _by_quantity(words: str, before: ByHorizon, after: ByHorizon, floor: ByHorizon) -> dict[str, Levels]:
    return {
        f"{_WORDS[quantity]} after {horizon:g} s{words}": _levels(
            errors, after[horizon], floor.get(horizon), quantity
        )
        for quantity in QUANTITIES
        for horizon, errors in before.items()
        if getattr(errors, quantity) is not None and f"{_WORDS[quantity]}{words}" != _METRIC
    }


def _by_channel(first: PredictionErrors, last: PredictionErrors, horizon: float) -> dict[str, Levels]:
    before, after = first.by_channel()[horizon], last.by_channel()[horizon]
    floor = first.of_sensors.by_channel().get(horizon, {})
    return {
        channel: Levels(before=before[name], after=after[name], noise_floor=floor.get(name), unit=unit)
        for channel, (name, unit) in _CHANNELS.items()
    }


def _curve(errors: ByHorizon, quantity: str, first: PredictionErrors) -> FloatArray:
    values = [getattr(errors[h], quantity) if h in errors else None for h in first.horizons]
    return _floats(values)


def _floats(values: list[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values])
