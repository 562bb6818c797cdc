"""The person at the bench: does what a wizard asks, and reads off what it asks for.

Requests and replies are the JSON objects of the hands protocol (docs/sim_bench.md).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from onboard.json_file import as_json
from sim_backend.bench.bench import Bench, Place
from sim_backend.bench.errors import BenchError
from sim_backend.bench.hanging import BifilarDrone, Strings, air_inertia, strung
from sim_backend.bench.readings import JIG, Grade
from sim_backend.bench.scpi import CURRENT_MAX, VOLTAGE_MAX

TWIST_LIMIT = math.radians(90.0)
TWIST_ERROR = 0.05
"""A twist by hand is this much off, relative standard deviation."""
NEARLY_STILL = 20.0
"""rad/s of a rotor that a finger may stop."""
WEIGHT_ERROR = 1e-4
"""Largest relative error of a calibration weight (OIML class M1, rounded up)."""

SWITCHING_S = 0.5
"""Until the supply gives what it was told to by its knobs."""

Request = Mapping[str, Any]
Replug = Callable[[str], str]


class CannotDo(BenchError):
    """The person cannot do that now; the message is the reply."""


@dataclass(frozen=True, slots=True)
class Reply:
    """What the person answers, and the bench time (s) at which."""

    document: dict[str, Any]
    at: float


class SimulatedOperator:
    """A person with two hands and instruments of a grade.

    Args:
        bench: what they work at.
        replug: pulls an instrument's plug and puts it in again; gives its new name.
        grade: errors of their readings.
    """

    def __init__(self, bench: Bench, replug: Replug, grade: Grade = JIG) -> None:
        self._bench = bench
        self._replug = replug
        self._grade = grade
        self._rng = bench.hands_rng
        self._inertia = air_inertia(bench.vehicle, self._rng)
        self._asked: Strings | None = None
        self._strings: Strings | None = None
        self._remembered = 0.0
        self._actions: dict[str, Callable[[Request], float]] = {
            "hang": self._hang,
            "twist": self._twist,
            "damp": self._damp,
            "take_down": self._take_down,
            "clamp": self._clamp,
            "mount_on_scale": self._mount_on_scale,
            "put_weight": self._put_weight,
            "remove_weight": self._remove_weight,
            "place_on_floor": self._place_on_floor,
            "read_scale": self._read_scale,
            "set_supply": self._set_supply,
            "switch_supply": self._switch_supply,
        }
        self._readings: dict[str, Callable[[], tuple[float, str]]] = {
            "mass": self._mass,
            "string_distance_top": lambda: (self._distance(self._hung_strings().top), "m"),
            "string_distance_bottom": lambda: (self._distance(self._hung_strings().bottom), "m"),
            "string_length": self._length,
            "jig_mass": lambda: (bench.options.jig.mass, "kg"),
            "jig_inertia": lambda: (bench.options.jig.inertia, "kg m2"),
            "blades": lambda: (2, "1"),
            "supply_voltage": self._supply_voltage,
            "scale_reading": lambda: (self._remembered, "kg"),
        }

    def perform(self, request: Request) -> Reply:
        """Do or read what is asked; the reply says so, or why not."""
        now = self._bench.time
        try:
            if "do" in request:
                return self._do(request)
            if "ask" in request:
                return Reply(self._ask(request["ask"]), now)
        except CannotDo as error:
            return Reply({"error": str(error)}, now)
        return Reply({"error": 'say {"do": ...} or {"ask": ...}'}, now)

    def _do(self, request: Request) -> Reply:
        name = request["do"]
        now = self._bench.time
        if name == "replug":
            return Reply({"done": True, "device": self._replug(_text(request, "instrument"))}, now)
        action = self._actions.get(name) if isinstance(name, str) else None
        if action is None:
            raise CannotDo(f"do {name!r}? I know {', '.join([*self._actions, 'replug'])}")
        return Reply({"done": True}, now + action(request))

    def _ask(self, name: Any) -> dict[str, Any]:
        if name == "spin_record":
            record = self._bench.record
            spins = {"now": self._bench.time, "spins": as_json(record.spins), "incidents": record.incidents}
            return {"value": spins, "unit": "s"}
        reading = self._readings.get(name) if isinstance(name, str) else None
        if reading is None:
            raise CannotDo(f"ask for {name!r}? I can read {', '.join([*self._readings, 'spin_record'])}")
        value, unit = reading()
        return {"value": value, "unit": unit}

    # Doing. Each gives the s that it takes.

    def _hang(self, request: Request) -> float:
        self._refuse_turning("hang the drone up")
        axis = _direction(request)
        asked = Strings(
            _number(request, "string_distance_top", 0.005, 1.0),
            _number(request, "string_distance_bottom", 0.005, 1.0),
            _number(request, "string_length", 0.05, 5.0),
        )
        if asked.length <= max(asked.top, asked.bottom):
            raise CannotDo("strings shorter than they are apart cannot hold the drone; are the units m?")
        if asked != self._asked or self._strings is None:
            self._asked, self._strings = asked, strung(asked, self._rng)
        bench = self._bench
        bench.put(Place.HANGING)
        bench.hung = BifilarDrone(
            self._strings,
            axis,
            self._inertia,
            bench.vehicle.body.mass.value,
            bench.options.jig,
            self._rng,
            bench.options.faults,
        )
        return 0.0

    def _twist(self, request: Request) -> float:
        hung = self._hanging()
        angle = _number(request, "angle", -TWIST_LIMIT, TWIST_LIMIT)
        self._refuse_turning("touch the drone")
        if self._bench.firmware.supervisor.is_armed:
            raise CannotDo("the drone is armed: disarm it before I touch it")
        return hung.twist(angle * (1.0 + TWIST_ERROR * float(self._rng.standard_normal())))

    def _damp(self, request: Request) -> float:
        return self._hanging().damp()

    def _take_down(self, request: Request) -> float:
        self._hanging()
        self._bench.put(Place.FLOOR)
        return 0.0

    def _clamp(self, request: Request) -> float:
        motor = _number(request, "motor", 1, 4)
        if motor != int(motor):
            raise CannotDo(f"motor {motor:g}: 1, 2, 3 or 4")
        self._refuse_turning("clamp the drone")
        self._bench.watched = int(motor)
        self._bench.put(Place.CLAMPED)
        return 0.0

    def _mount_on_scale(self, request: Request) -> float:
        self._refuse_turning("mount the drone")
        self._bench.put(Place.ON_SCALE)
        return 0.0

    def _put_weight(self, request: Request) -> float:
        mass = _number(request, "mass", 0.0, 2.0)
        self._bench.weights = mass * (1.0 + WEIGHT_ERROR * float(self._rng.uniform(-1.0, 1.0)))
        return 0.0

    def _remove_weight(self, request: Request) -> float:
        self._bench.weights = 0.0
        return 0.0

    def _place_on_floor(self, request: Request) -> float:
        self._refuse_turning("pick the drone up")
        self._bench.put(Place.FLOOR)
        return 0.0

    def _read_scale(self, request: Request) -> float:
        self._remembered = 1e-3 * self._bench.balance.indication()
        return 0.0

    def _set_supply(self, request: Request) -> float:
        supply = self._bench.supply
        supply.voltage = _number(request, "voltage", 0.0, VOLTAGE_MAX)
        supply.current_limit = _number(request, "current_limit", 0.0, CURRENT_MAX)
        return SWITCHING_S

    def _switch_supply(self, request: Request) -> float:
        on = request.get("on")
        if not isinstance(on, bool):
            raise CannotDo(f"on is {on!r}: true or false")
        self._bench.supply.output = on
        return SWITCHING_S

    def _refuse_turning(self, what: str) -> None:
        if self._bench.driven or float(self._bench.motors.speed.max()) > NEARLY_STILL:
            raise CannotDo(f"the motors turn: stop them before I {what}")

    def _hanging(self) -> BifilarDrone:
        if self._bench.hung is None:
            raise CannotDo("the drone is not hanging: hang it first")
        return self._bench.hung

    # Reading.

    def _hung_strings(self) -> Strings:
        if self._strings is None:
            raise CannotDo("there are no strings: hang the drone first")
        return self._strings

    def _mass(self) -> tuple[float, str]:
        truth = self._bench.vehicle.body.mass.value + self._bench.options.jig.mass
        return self._grade.read(truth, self._grade.mass, self._rng), "kg"

    def _distance(self, truth: float) -> float:
        return self._grade.read(truth, self._grade.distance, self._rng)

    def _length(self) -> tuple[float, str]:
        return self._grade.read(self._hung_strings().length, self._grade.length, self._rng), "m"

    def _supply_voltage(self) -> tuple[float, str]:
        bench = self._bench
        truth = bench.board_voltage if bench.on_supply else bench.supply.terminal
        return self._grade.read(truth, self._grade.voltage * truth, self._rng), "V"


def _number(request: Request, name: str, low: float, high: float) -> float:
    value = request.get(name)
    if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
        raise CannotDo(f"{name} is {value!r}: I need a number from {low:g} to {high:g} in SI units")
    return float(value)


def _text(request: Request, name: str) -> str:
    value = request.get(name)
    if not isinstance(value, str):
        raise CannotDo(f"{name} is {value!r}: I need a name")
    return value


def _direction(request: Request) -> np.ndarray[Any, np.dtype[np.float64]]:
    axis = request.get("axis")
    right = isinstance(axis, list) and len(axis) == 3 and all(isinstance(x, int | float) for x in axis)
    vector = np.array(axis, dtype=float) if right else np.zeros(3)
    length = float(np.linalg.norm(vector))
    if not (math.isfinite(length) and length > 1e-6):
        raise CannotDo(f"axis is {axis!r}: I need the body direction that shall point up, [x, y, z]")
    return np.asarray(vector / length)
