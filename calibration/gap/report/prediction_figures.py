"""The gap between a model and flights: the same flights predicted by one model after the other.

`stages` are :class:`~calibration.gap.replay.evaluation.PredictionErrors` of the same flights by name: before,
after each effect, at last with all of them.
"""

from collections.abc import Iterable, Mapping

from calibration.gap.replay.evaluation import ErrorPair, PredictionErrors
from calibration.gap.replay.flight_prediction import QUANTITIES, ByHorizon, HorizonErrors
from calibration.gap.report.document import METRIC, Gap, Levels
from onboard.vehicle.unnamed import UnnamedCurve

Stages = Mapping[str, PredictionErrors]

_UNITS = dict(zip(QUANTITIES, ("m", "m/s", "deg", "rad/s"), strict=True))
_WORDS = dict(zip(QUANTITIES, ("position", "velocity", "attitude", "rate"), strict=True))
HORIZON = 1.0
"""s, of the error that stands for the whole gap."""

_CHANNEL_HORIZON = 0.5
"""s: long against the noise, short against what one channel does to another."""
_CHANNELS = {
    **{f"force_{axis}": (f"velocity_{axis}_m_s", "m/s") for axis in "xyz"},
    **{f"torque_{axis}": (f"rate_{axis}_rad_s", "rad/s") for axis in "xyz"},
}
"""Channel by the prediction error that shows it, and its unit."""

_TORQUES = ("torque_x", "torque_y", "torque_z")


def stage_gaps(stages: Stages) -> dict[str, Gap]:
    """The gap of each stage, held against the first."""
    first = next(iter(stages.values()))
    return {name: prediction_gap({"before": first, "after": errors}) for name, errors in stages.items()}


def prediction_gap(stages: Stages) -> Gap:
    """The gap of first and last stage: position after :data:`HORIZON` with given attitude, and all else.

    Where no flight reaches that far, the longest horizon that one does reach stands for it.

    Channels are velocity errors with given attitude ("force_x", m/s) and open-loop rate errors ("torque_x",
    rad/s) along the body axes after half a second.
    """
    first, *_ = stages.values()
    *_, last = stages.values()
    horizon = _within_reach(first, HORIZON)
    one, other, floor = first.overall, last.overall, first.floor or ErrorPair({}, {})
    predictions = {
        **_by_quantity("attitude given", one.given_attitude, other.given_attitude, floor.given_attitude),
        **_by_quantity("all predicted", one.open_loop, other.open_loop, floor.open_loop),
        **_by_quantity("torque estimated", first.with_torque_estimate, last.with_torque_estimate, {}),
    }
    return Gap(
        metric=f"position error after {horizon:g} s, attitude given",
        overall=predictions[METRIC][horizon],
        predictions=predictions,
        by_channel=_by_channel(first, last, _within_reach(first, _CHANNEL_HORIZON)),
        by_phase=_by_phase(first, last, horizon),
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


def _by_quantity(
    way: str, before: ByHorizon, after: ByHorizon, floor: ByHorizon
) -> dict[str, dict[float, Levels]]:
    """Levels of what is predicted in one way, by quantity and horizon."""
    return {
        f"{_WORDS[quantity]}, {way}": {
            horizon: _levels(errors, after[horizon], floor.get(horizon), quantity)
            for horizon, errors in before.items()
            if getattr(errors, quantity) is not None
        }
        for quantity in QUANTITIES
    }


def _by_channel(first: PredictionErrors, last: PredictionErrors, horizon: float) -> dict[str, Levels]:
    before, after = first.by_channel()[horizon], last.by_channel()[horizon]
    floor = first.of_sensors.by_channel().get(horizon, {})
    return {
        channel: Levels(before=before[name], after=after[name], noise_floor=floor.get(name), unit=unit)
        for channel, (name, unit) in _CHANNELS.items()
    }


def _by_phase(first: PredictionErrors, last: PredictionErrors, horizon: float) -> dict[str, Levels]:
    before, after, floor = (
        {phase: pair.given_attitude[horizon] for phase, pair in of.items() if horizon in pair.given_attitude}
        for of in (first.by_phase(), last.by_phase(), first.of_sensors.by_phase())
    )
    return {
        phase: _levels(errors, after[phase], floor.get(phase), "position_m")
        for phase, errors in before.items()
        if phase in after
    }
