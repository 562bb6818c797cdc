"""What every vehicle of a grid predicts of every flight, with nothing simulated twice.

The vehicles differ in legs, pads and hull alone, so each flip is flown to the ceiling once for all of them.
Landings are simulated with pads of one limit each, in rising order, and a spread of limits mixes them; limits
that cannot have changed a landing are not tried on it (:mod:`..kernels`), nor is a hull within one that never
touched.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np

from calibration.gap.estimate.model import WORKERS
from calibration.gap.landings.outcomes.kernels import APPROACH, approach, land
from calibration.gap.landings.outcomes.labels import shares_of
from calibration.gap.landings.outcomes.pad_laws import PadLaw, mixture, pad_laws
from calibration.gap.landings.outcomes.predict import scattered
from calibration.gap.landings.outcomes.prepare import SETTINGS, PreparedLandings
from calibration.gap.landings.outcomes.vehicles import Point, with_point, without_pads
from onboard.arrays import FloatArray, IntArray
from sim_backend.physics.feet import IMPULSE, PUSH, SPEED, UPRIGHT
from sim_backend.physics.parameters import PARAMETERS
from sim_backend.physics.rollout import ROLLOUT

_LAWS = {"pads": SPEED, "preload": PUSH, "impulse": IMPULSE, "angle": UPRIGHT}

_HULL = ("reach", "width", "top", "bottom")
"""Coordinates that grow with hull and propellers."""


@dataclass(frozen=True)
class _Ladder:
    """Vehicles alike but for one limit of their pads, which rises.

    Attributes:
        points: the vehicles. law: whose limit it is (:mod:`sim_backend.physics.feet`).
    """

    points: tuple[Point, ...]
    law: int

    @property
    def size(self) -> tuple[float, ...]:
        """Of hull and propellers."""
        return tuple(getattr(self.points[0], name) for name in _HULL)

    @property
    def but_for_size(self) -> tuple[Any, ...]:
        """What vehicles of one family have in common."""
        return self.law, *(point._replace(**dict.fromkeys(_HULL, 0.0)) for point in self.points)

    def holds(self, other: "_Ladder") -> bool:
        """Whether hull and propellers of a vehicle of the same family lie within those of this one."""
        return all(own >= its for own, its in zip(self.size, other.size, strict=True))


@dataclass(frozen=True)
class _Arrived:
    """A flight's landings just before anything touches.

    Attributes:
        states: (n,). ways: of :func:`..kernels.approach` (n,). flips: thrusts (N, (n, 4)). ceiling: m.
    """

    states: Any
    ways: Any
    flips: FloatArray
    ceiling: float


def tabulate(
    prepared: PreparedLandings,
    parameters: Any,
    points: Sequence[Point],
    progress: Callable[[float], None] = lambda _: None,
) -> FloatArray:
    """Probabilities (points, flights, 3) of four legs, two, none.

    Whoever interrupts it is not kept waiting: the landings in hand, a second of them, end on threads of their
    own, and none are begun after them.

    Args:
        prepared: the flights. parameters: of the vehicle without these effects (:func:`..bare_parameters`).
        points: vehicles.
        progress: called with the share done, 0..1.
    """
    laws = pad_laws(parameters)
    mixed = [_mixed(point, laws) for point in points]
    ladders = _ladders([one for parts in mixed for one in parts], laws)
    arrived = [_arrive(prepared, index, parameters) for index in range(len(prepared.starts))]
    families = _families(ladders)
    over = Event()

    def landed(one: _Arrived, family: Sequence[_Ladder], vehicles: Sequence[Any]) -> dict[Point, FloatArray]:
        if over.is_set():
            raise CancelledError
        return _land_family(one, family, vehicles)

    def simulated(family: Sequence[_Ladder]) -> dict[Point, FloatArray]:
        vehicles = [
            np.array([with_point(parameters, one) for one in ladder.points], dtype=PARAMETERS)
            for ladder in family
        ]
        flights = [landed(one, family, vehicles) for one in arrived]
        return {point: np.array([shares[point] for shares in flights]) for point in flights[0]}

    found: dict[Point, FloatArray] = {}
    pool = ThreadPoolExecutor(WORKERS)
    try:
        for index, shares in enumerate(pool.map(simulated, families)):
            found |= shares
            progress((index + 1) / len(families))
    finally:
        over.set()
        pool.shutdown(wait=False, cancel_futures=True)
    return np.array([np.sum([share * found[one] for one, share in parts.items()], axis=0) for parts in mixed])


def _arrive(prepared: PreparedLandings, index: int, parameters: Any) -> _Arrived:
    """A flight's landings up to the ceiling."""
    p = parameters.copy()
    p["ceiling_z"] = prepared.ceilings[index]
    states, flips = scattered(prepared.starts[index], prepared.dispersion, prepared.draws[index], p)
    ways = np.zeros(len(states), dtype=APPROACH)
    approach(states, p, flips, SETTINGS, np.zeros(len(states), dtype=ROLLOUT), ways)
    return _Arrived(states, ways, flips, float(p["ceiling_z"]))


def _land_family(
    arrived: _Arrived, family: Sequence[_Ladder], vehicles: Sequence[Any]
) -> dict[Point, FloatArray]:
    """Shares (3,) of four legs, two, none, of one flight's landings with each vehicle of a family."""
    feet: list[IntArray] = []
    bodies: list[IntArray] = []
    out = np.zeros(1, dtype=ROLLOUT)
    for ladder, filed in zip(family, vehicles, strict=True):
        own = filed.copy()
        own["ceiling_z"] = arrived.ceiling
        known = np.full((len(arrived.states), len(own)), -1)
        for larger, held, touched in zip(family, feet, bodies, strict=False):
            if larger.holds(ladder):
                known = np.where((known < 0) & (touched == 0), held, known)
        contact = np.zeros_like(known)
        land(
            arrived.states, arrived.ways, own, ladder.law, arrived.flips, SETTINGS, out[0], known, contact
        )  # fmt: skip
        feet.append(known)
        bodies.append(contact)
    return {
        point: shares_of(held)
        for ladder, table in zip(family, feet, strict=True)
        for point, held in zip(ladder.points, table.T, strict=True)
    }


def _ladders(points: Sequence[Point], laws: dict[str, PadLaw]) -> list[_Ladder]:
    """All vehicles, each once: those that one limit tells apart together."""
    found: dict[tuple[Point, str], list[Point]] = {}
    alone: dict[Point, None] = {}
    for point in dict.fromkeys(points):
        ruling = _ruling(point, laws)
        if len(ruling) == 1 and getattr(point, laws[ruling[0]].spread) == 0.0:
            found.setdefault((without_pads(point, laws), ruling[0]), []).append(point)
        else:
            alone[point] = None
    ladders = []
    for (body, name), rungs in found.items():
        law = laws[name]
        if body in alone:  # the lowest rung of its first ladder
            del alone[body]
            rungs.append(body)
        rungs.sort(key=lambda one: getattr(one, law.limit), reverse=name == "angle")
        ladders.append(_Ladder(tuple(rungs), _LAWS[name]))
    return ladders + [_Ladder((one,), SPEED) for one in alone]


def _families(ladders: Sequence[_Ladder]) -> list[list[_Ladder]]:
    """Vehicles that differ in hull and propellers alone, large ones first."""
    found: dict[tuple[Any, ...], list[_Ladder]] = {}
    for ladder in sorted(ladders, key=lambda one: one.size, reverse=True):
        found.setdefault(ladder.but_for_size, []).append(ladder)
    return list(found.values())


def _ruling(point: Point, laws: dict[str, PadLaw]) -> list[str]:
    """Names of the laws of pads that a vehicle has."""
    body = without_pads(point, laws)
    return [
        name for name, law in laws.items()
        if getattr(point, law.limit) != getattr(body, law.limit) or getattr(point, law.spread) > 0.0
    ]  # fmt: skip


def _mixed(point: Point, laws: dict[str, PadLaw]) -> dict[Point, float]:
    """The vehicles of one limit that a vehicle is made of, and their shares."""
    ruling = _ruling(point, laws)
    if len(ruling) != 1:
        return {point: 1.0}  # of several laws at once each landing draws its own limits
    law, body = laws[ruling[0]], without_pads(point, laws)
    shares = mixture(law.limits, getattr(point, law.limit), getattr(point, law.spread))
    rungs = [body._replace(**{law.limit: limit}) for limit in law.limits]
    return {rung: float(share) for rung, share in zip(rungs, shares, strict=True)}
