"""How well a model predicts flights, by horizon, flight, phase and channel, and how well anything could."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from calibration.errors import CalibrationError
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.flight_prediction import (
    QUANTITIES,
    SCALES,
    ByHorizon,
    Replay,
    WindowErrors,
    in_body_axes,
    mean_by_horizon,
    prediction_errors,
)
from calibration.gap.replay.floors import accelerometer_driven, gyro_driven
from calibration.gap.replay.hover_voltage import Unpredicted, thrust_needed, with_voltages
from calibration.gap.replay.inputs import PredictionInputs, motor_starts, prediction_inputs
from calibration.gap.replay.nuisances import LEAST_STARTS, Nuisances, fit_nuisances
from calibration.gap.replay.torque_estimate import HORIZON as TORQUE_HORIZON
from calibration.gap.replay.torque_estimate import with_torque_estimate
from calibration.gap.replay.windows import (
    PHASES,
    Rows,
    phase_indices,
    rows_between,
    start_rows,
    usable_lengths,
)
from onboard.arrays import BoolArray, FloatArray
from onboard.errors import InputError
from onboard.vehicle import Vehicle

HORIZONS = (0.1, 0.25, 0.5, 1.0)
"""s."""
START_EVERY = 0.1
"""s from one start to the next."""
ORDINARY_THRUST = (0.8, 1.25)
"""Thrust of a flight over that of its model beyond which the vehicle file is probably another vehicle's."""
_AXES = ("x", "y", "z")


class PredictionError(CalibrationError, InputError):
    """Nothing can be predicted; the message says of which flight and why."""


@dataclass(frozen=True)
class BothWays:
    """Errors of one flight, with everything predicted and with attitude and rate given."""

    open_loop: WindowErrors
    given_attitude: WindowErrors

    def in_body_axes(self, rotation: FloatArray) -> FloatArray:
        """Position and velocity with given attitude, attitude and rate open loop, shape (m, h, 4, 3).

        Args:
            rotation: attitude at the starts, whose body axes are taken, shape (m, 3, 3).
        """
        given = in_body_axes(self.given_attitude, rotation)[:, :, :2]
        return np.concatenate([given, self.open_loop.vectors[:, :, 2:]], axis=2)


@dataclass(frozen=True)
class FlightErrors:
    """Errors of one flight.

    Attributes:
        floor: of gyro and accelerometer in its place; None without an accelerometer.
        torque_estimate: at 0.1 s with the disturbance torque of the last 0.2 s.
        phases: index in :data:`~calibration.gap.replay.windows.PHASES` of each start, shape (m,).
        rotation: attitude at the starts, shape (m, 3, 3).
        nuisances: what the flight was given beside the model.
        thrust_ratio: mean thrust that the flight had over what the model makes of the logged commands.
    """

    record: FlightRecord
    model: BothWays
    floor: BothWays | None
    torque_estimate: WindowErrors
    phases: Rows
    rotation: FloatArray
    nuisances: Nuisances
    thrust_ratio: float


@dataclass(frozen=True)
class ErrorPair:
    """Mean errors of both ways of predicting."""

    open_loop: ByHorizon
    given_attitude: ByHorizon

    def json_shape(self) -> dict[str, Any]:
        """``{"horizons": {"0.5": {...}}, "given_attitude": {"0.5": {...}}}``."""
        return {
            "horizons": self.open_loop,
            "given_attitude": self.given_attitude,
        }


@dataclass(frozen=True)
class PredictionErrors:
    """Errors of a model on flights; every mean is over starts, not over flights.

    Attributes:
        horizons: s.
        calibrated_s: s at the beginning of each flight that its nuisances were fitted to; 0: none were.
    """

    horizons: tuple[float, ...]
    flights: tuple[FlightErrors, ...]
    unpredicted: tuple[Unpredicted, ...] = field(default=())
    calibrated_s: float = 0.0

    @property
    def overall(self) -> ErrorPair:
        """Errors over all starts of all flights."""
        return self._pair(self.flights)

    @property
    def of_sensors(self) -> "PredictionErrors":
        """The inertial sensors in place of the model, on the flights with an accelerometer."""
        flights = tuple(replace(f, model=f.floor) for f in self.flights if f.floor is not None)
        return replace(self, flights=flights)

    @property
    def floor(self) -> ErrorPair | None:
        """Errors of the sensors over all starts; None without an accelerometer."""
        return self.of_sensors.overall if self.of_sensors.flights else None

    @property
    def with_torque_estimate(self) -> ByHorizon:
        """At 0.1 s with a causal estimate of the disturbance torque."""
        return _means([flight.torque_estimate for flight in self.flights], (TORQUE_HORIZON,))

    def by_flight(self) -> list[ErrorPair]:
        """Errors of each flight."""
        return [self._pair([flight]) for flight in self.flights]

    def by_phase(self) -> dict[str, ErrorPair]:
        """Errors over the starts of each phase that occurs."""
        occurring = {index for flight in self.flights for index in flight.phases.tolist()}
        return {
            phase: self._pair(self.flights, index) for index, phase in enumerate(PHASES) if index in occurring
        }

    def by_channel(self) -> dict[float, dict[str, float]]:
        """Mean absolute errors along the body axes of the start, by horizon: ``velocity_x_m_s`` and so on.

        Position and velocity with given attitude, attitude and rate open loop: so each channel shows one
        equation of motion. Quantities that nobody predicts (the sensors' rates) are left out.
        """
        if not self.flights:
            return {}
        absolute = np.abs(np.concatenate([f.model.in_body_axes(f.rotation) for f in self.flights]))
        channels: dict[float, dict[str, float]] = {}
        for index, horizon in enumerate(self.horizons):
            reached = absolute[np.isfinite(absolute[:, index, 0, 0]), index]
            if reached.shape[0] == 0:
                continue
            means = reached.mean(axis=0) * np.asarray(SCALES)[:, None]
            channels[horizon] = {
                name.replace("_", f"_{axis}_", 1): float(means[q, a])
                for q, name in enumerate(QUANTITIES)
                for a, axis in enumerate(_AXES)
                if np.isfinite(means[q, a])
            }
        return channels

    def doubts(self) -> Iterator[str]:
        """What should be looked at before the numbers are believed, in words."""
        low, high = ORDINARY_THRUST
        ratios = sorted(f.thrust_ratio for f in self.flights if not low < f.thrust_ratio < high)
        if ratios:
            yield (
                f"{len(ratios)} of {len(self.flights)} flights had {ratios[0]:.2f} to {ratios[-1]:.2f} times "
                "the thrust that the model makes of their commands: is this the vehicle that flew?"
            )
        lost = max((errors.diverged for errors in self.overall.open_loop.values()), default=0)
        if lost:
            yield f"from {lost} starts the model runs away to no number at all; they are not in the means"

    def json_shape(self) -> dict[str, Any]:
        """The document of ``perchhw gap evaluate``."""
        return {
            **self.overall.json_shape(),
            "flights": len(self.flights),
            "floor": self.floor,
            "with_torque_estimate": self.with_torque_estimate,
            "by_channel": self.by_channel(),
            "by_phase": self.by_phase(),
            "by_flight": [
                {
                    "flight": flight.record.name,
                    "file": flight.record.source,
                    "shape": flight.record.shape,
                    **pair.json_shape(),
                    "thrust_ratio": flight.thrust_ratio,
                    "nuisances": flight.nuisances if self.calibrated_s else None,
                }
                for flight, pair in zip(self.flights, self.by_flight(), strict=True)
            ],
            "calibrated_first_s": self.calibrated_s,
            "doubts": list(self.doubts()),
            "unpredicted": [
                {"flight": item.record.name, "file": item.record.source, "reason": item.reason}
                for item in self.unpredicted
            ],
        }

    def _pair(self, flights: Sequence[FlightErrors], phase: int | None = None) -> ErrorPair:
        """Errors over the starts of flights: all, or those of the phase with that index."""
        masks = [f.phases == phase for f in flights] if phase is not None else None
        return ErrorPair(
            _means([f.model.open_loop for f in flights], self.horizons, masks),
            _means([f.model.given_attitude for f in flights], self.horizons, masks),
        )


def _means(
    errors: Sequence[WindowErrors], horizons: tuple[float, ...], masks: Sequence[BoolArray] | None = None
) -> ByHorizon:
    """Means over the starts of several flights: over all, or those that the masks choose."""
    chosen: Sequence[Any] = [slice(None)] * len(errors) if masks is None else masks
    norms = np.concatenate([one.norms()[rows] for one, rows in zip(errors, chosen, strict=True)])
    reached = np.concatenate([one.reached[rows] for one, rows in zip(errors, chosen, strict=True)])
    return mean_by_horizon(norms, reached, horizons)


def evaluate(
    records: Sequence[FlightRecord],
    vehicle: Vehicle,
    horizons: Sequence[float] = HORIZONS,
    calibrate_first_s: float = 0.0,
) -> PredictionErrors:
    """Predict flights with a model from a start every 0.1 s.

    A start and its horizon lie in free flight, with pose, gyro and motor commands known from 0.15 s before
    the start on. The start velocity comes from the past alone. Where the vehicle file says that pose or gyro
    are wrong, that is taken out of the measurements first; so for records from which it was removed already,
    give a vehicle without those effects. A flight without a measured voltage gets the one at which the model
    hovers (:mod:`calibration.gap.replay.hover_voltage`).

    Args:
        horizons: s, increasing.
        calibrate_first_s: s of each flight to which its thrust scale, lean and trim are fitted; only the rest
            is scored. 0: nothing is fitted and all is scored.

    Raises:
        PredictionError: horizons that are not increasing, or not a single flight with a start to score.
        SimulationError: the vehicle has an effect without an equation.
    """
    wanted = tuple(float(h) for h in horizons)
    if not wanted or wanted[0] <= 0.0 or any(b <= a for a, b in pairwise(wanted)):
        raise PredictionError(f"horizons {', '.join(map(str, wanted))}: must be positive and increasing (s)")
    if not calibrate_first_s >= 0.0:
        raise PredictionError(f"calibration over the first {calibrate_first_s} s: must not be negative")
    done: list[FlightErrors] = []
    carried, left = with_voltages(records, vehicle)
    for record in carried:
        result = _flight(record, vehicle, wanted, calibrate_first_s)
        if isinstance(result, FlightErrors):
            done.append(result)
        else:
            left.append(result)
    if not done:
        reasons = "; ".join(f"{item.record.source}: {item.reason}" for item in left) or "no flights"
        raise PredictionError(f"nothing to predict: {reasons}")
    return PredictionErrors(wanted, tuple(done), tuple(left), calibrate_first_s)


def _flight(
    record: FlightRecord, vehicle: Vehicle, horizons: tuple[float, ...], calibrate_first_s: float
) -> FlightErrors | Unpredicted:
    ends = np.array([round(h / record.dt) for h in horizons])
    if ends[0] < 1 or np.any(np.diff(ends) < 1):
        return Unpredicted(record, f"samples {record.dt:g} s apart are too coarse for these horizons")
    inputs = prediction_inputs(record, vehicle)
    lengths = usable_lengths(inputs)
    rows = start_rows(lengths, max(1, round(START_EVERY / record.dt)), int(ends[0]))
    nuisances = Nuisances()
    if calibrate_first_s > 0.0 and rows.size:
        split = float(record.t[np.argmax(record.flying)]) + calibrate_first_s
        fitted = _calibrated(inputs, lengths, split)
        if fitted is None:
            return Unpredicted(
                record,
                f"fewer than {LEAST_STARTS} usable starts in the first {calibrate_first_s:g} s of the flight",
            )
        nuisances = fitted
        rows = rows_between(rows, record.t, split, np.inf)
    if rows.size == 0:
        return Unpredicted(
            record,
            f"no {horizons[0]:g} s of free flight with pose, gyro and motor commands known"
            + (f" after the first {calibrate_first_s:g} s" if calibrate_first_s else ""),
        )
    # A voltage that was made makes both equal, and tells instead.
    ratio = _thrust_ratio(inputs) if record.voltage_measured else thrust_needed(record, vehicle)
    return _scored(inputs, rows, ends, lengths[rows], nuisances, ratio)


def _calibrated(inputs: PredictionInputs, lengths: Rows, split: float) -> Nuisances | None:
    """Nuisances from what lies before the time `split` (s)."""
    every = max(1, round(0.5 * START_EVERY / inputs.dt))
    rows = rows_between(start_rows(lengths, every, 1), inputs.record.t, -np.inf, split)
    until_split = np.searchsorted(inputs.record.t, split) - rows
    return fit_nuisances(inputs, rows, np.minimum(lengths[rows], until_split))


def _scored(
    inputs: PredictionInputs, rows: Rows, ends: Rows, lengths: Rows, nuisances: Nuisances, thrust_ratio: float
) -> FlightErrors:
    replay = nuisances.replay(inputs, rows, ends, lengths)
    model = BothWays(
        prediction_errors(inputs, replay), prediction_errors(inputs, replace(replay, given_attitude=True))
    )
    return FlightErrors(
        record=inputs.record,
        model=model,
        floor=_floor(inputs, replay, np.array(nuisances.accelerometer_bias_m_s2)),
        torque_estimate=with_torque_estimate(inputs, rows, lengths, nuisances),
        phases=phase_indices(inputs, rows),
        rotation=inputs.rotation[rows],
        nuisances=nuisances,
        thrust_ratio=thrust_ratio,
    )


def _floor(inputs: PredictionInputs, replay: Replay, bias: FloatArray) -> BothWays | None:
    if inputs.record.specific_force is None:
        return None
    return BothWays(gyro_driven(inputs, replay, bias), accelerometer_driven(inputs, replay, bias))


def _thrust_ratio(inputs: PredictionInputs) -> float:
    """Mean thrust that was needed over mean thrust of the model, along the body's axis, where it is known."""
    _, thrust = motor_starts(inputs, inputs.parameters, np.array([0]))
    acceleration = np.gradient(inputs.velocity, inputs.dt, axis=0)
    acceleration[:, 2] += inputs.parameters["gravity"]
    needed = inputs.parameters["mass"] * np.einsum("ni,ni->n", inputs.rotation[:, :, 2], acceleration)
    known = inputs.known & inputs.record.flying
    return float(needed[known].mean() / thrust[known].sum(axis=1).mean())
