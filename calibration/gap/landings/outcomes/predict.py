"""Each flight simulated many times from its recorded trigger: how likely four legs, two, or none hold."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.gap.landings.outcomes.dispersion import Dispersion
from calibration.gap.landings.outcomes.kernels import fly_flips
from calibration.gap.landings.outcomes.labels import shares_of
from calibration.gap.landings.outcomes.prepare import SETTINGS, PreparedLandings
from calibration.gap.landings.outcomes.starts import TriggerStart
from onboard.arrays import FloatArray
from sim_backend.physics.rollout import ROLLOUT
from sim_backend.physics.state import new_states


@dataclass(frozen=True)
class Forecast:
    """What the simulation expects of one flight.

    Attributes:
        probability: (3,), of four legs, two, none (:mod:`..labels`).
        body_contact: probability that hull or propellers touch the ceiling.
        held: simulated landings in which a leg holds.
        body_contact_held: share of these that touch so; None: there are none.
        contact: s after the trigger, median of the first contact; None: most never touch.
        measured_contact: s, from the gyro; None: unseen.
    """

    name: str
    probability: FloatArray
    body_contact: float
    held: int
    body_contact_held: float | None
    contact: float | None
    measured_contact: float | None


@dataclass(frozen=True)
class OutcomeForecast:
    """All flights, in the order of the starts."""

    flights: tuple[Forecast, ...]
    draws: int

    @property
    def probability(self) -> FloatArray:
        """Probabilities (n, 3)."""
        return np.array([flight.probability for flight in self.flights])


def forecast(
    prepared: PreparedLandings, parameters: Any, progress: Callable[[float], None] = lambda _: None
) -> OutcomeForecast:
    """Simulate every flight with a record of physics parameters; the ceiling is that of each flight.

    `progress` is called with the share of the flights done, 0..1.
    """
    p = parameters.copy()
    found = []
    for index, start in enumerate(prepared.starts):
        p["ceiling_z"] = prepared.ceilings[index]
        found.append(_forecast_one(start, prepared, index, p))
        progress((index + 1) / len(prepared.starts))
    return OutcomeForecast(tuple(found), prepared.draws.shape[1])


def _forecast_one(start: TriggerStart, prepared: PreparedLandings, index: int, p: Any) -> Forecast:
    states, flips = scattered(start, prepared.dispersion, prepared.draws[index], p)
    out = np.zeros(len(states), dtype=ROLLOUT)
    fly_flips(states, p, flips, SETTINGS, out)
    shares = shares_of(out["feet"])
    touched = out["impact_time"][out["contact"] > 0]
    contact = float(np.median(touched)) if 2 * touched.size > len(out) else None
    body, held = out["body_contact"] > 0, out["feet"] > 0
    count = int(np.sum(held))
    return Forecast(
        name=start.name,
        probability=shares,
        body_contact=float(np.mean(body)),
        held=count,
        body_contact_held=float(np.mean(body[held])) if count else None,
        contact=contact,
        measured_contact=prepared.contact(index),
    )


def scattered(
    start: TriggerStart, dispersion: Dispersion, numbers: FloatArray, p: Any
) -> tuple[Any, FloatArray]:
    """States (n,) and flip thrusts (N, (n, 4)) about a start, from standard normal numbers (n, ERRORS)."""
    states = new_states(len(numbers))
    states[:] = start.state[0]
    states["position"][:, 2] += dispersion.height * numbers[:, 0]
    states["velocity"] += np.array(dispersion.velocity) * numbers[:, 1:4]
    turn = Rotation.from_rotvec(np.array(dispersion.attitude) * numbers[:, 4:7])
    states["quaternion"] = (Rotation.from_quat(start.state["quaternion"][0]) * turn).as_quat()
    states["omega"] += np.array(dispersion.rate) * numbers[:, 7:10]
    states["pad_deviate"] = numbers[:, 12:]
    # A roll beside the pitch: one front motor gives more, the other less.
    per_side = float(p["inertia"][0] * p["arm_x"] / (p["inertia"][1] * p["arm_y"]))
    side = per_side * dispersion.roll * numbers[:, 11]
    gain = 1.0 + dispersion.pitch * numbers[:, 10]
    flips = np.outer(gain, start.flip)
    flips[:, :2] *= (1.0 + side)[:, None]
    flips[:, 2:] *= (1.0 - side)[:, None]
    return states, np.clip(flips, 0.0, float(p["thrust_max"]))
