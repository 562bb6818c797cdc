"""Sets of flights in crazyflow, a published simulator that nobody here wrote: its dynamics, integrators and
controller, and the four Crazyflies whose parameters come with it.

It runs in a Python of its own (`benchmarks/peers/crazyflow_room.py`). Drawn here are the lab, the paths and
what is hidden, with the same words as for the MuJoCo room; noise and what a log lacks are of that room, too.
The owner's vehicle file has the published parameters: masses, inertias (the rotors' too), levers and thrust
at its highest, as they are about hover the rotors' lags, levers of yaw and changes of speed (which turn the
body, too), no drag. crazyflow has no battery: a log's voltage stays as it is.
"""

import json
import math
import subprocess
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle
from tests.truth import paths
from tests.truth.airframe import Airframe, G, nominal
from tests.truth.drawn import (
    FLIGHTS,
    DrawnSet,
    answer_of,
    draw_circumstances,
    hide_something,
    write_log,
)
from tests.truth.lost import VehicleLost
from tests.truth.mujoco_room import STEP, Hidden, draw_gusts, measured

SCRIPT = Path(__file__).parents[2] / "benchmarks/peers/crazyflow_room.py"
KNOWN = (
    "thrust_scale", "motor_imbalance", "motor_lag", "motor_lag_asymmetry", "command_delay", "mass_error",
    "inertia_error", "linear_drag", "wind", "velocity_moment", "rate_damping", "pose_delay", "pose_rotation",
    "pose_offset", "gyro_bias",
)  # fmt: skip
"""Effects that its parameters, forces and torques can show."""

LEADS = {"euler": -0.5 * STEP, "symplectic_euler": 0.5 * STEP, "rk4": 0.0}
"""By integrator, s that poses are ahead of the rates beside them: a step's pose moves by the velocity at its
beginning, at its end, or by all of it."""

STATE_RATES = (100, 500)
"""Hz, of the loop of place and velocity: as it is published and in a Crazyflie, where commands then change
between the lines of most logs as no line shows, and as fast as the loop of attitude below it."""

RPM = 2.0 * math.pi / 60.0


class RoomEnded(RuntimeError):
    """The simulator's process ended; the message has its last words."""


class PublishedRoom:
    """The simulator as a process; a context manager.

    Attributes:
        drones: published parameters by name, known once it is entered.
    """

    def __init__(self, python: str) -> None:
        self._python = python
        self.drones: dict[str, dict[str, Any]] = {}

    def __enter__(self) -> "PublishedRoom":
        with ExitStack() as opened:
            self._folder = Path(opened.enter_context(TemporaryDirectory()))
            self._words = opened.enter_context((self._folder / "stderr.txt").open("w+", encoding="utf-8"))
            self._process = opened.enter_context(
                subprocess.Popen(
                    [self._python, str(SCRIPT)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=self._words,
                    cwd=self._folder,
                    text=True,
                )
            )
            self.drones = self._answer()["ready"]["drones"]
            self._opened = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    def fly(self, request: dict[str, Any], arrays: dict[str, np.ndarray]) -> np.ndarray:
        """Fly a set; the log (flights, steps, 17) as the script says.

        Raises:
            RoomEnded: it could not.
            VehicleLost: what it flew ends in numbers that no vehicle has.
        """
        given, flown = (self._folder / name for name in ("given.npz", "flown.npz"))
        np.savez(given, **arrays)
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({**request, "input": str(given), "output": str(flown)}) + "\n")
        self._process.stdin.flush()
        self._answer()
        return flown_to_the_end(np.load(flown)["log"])

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):  # its libraries print there as well
                return dict(json.loads(line))
        self._process.wait()
        self._words.seek(0)
        last = self._words.read().strip().splitlines()[-1:]
        raise RoomEnded(f"{SCRIPT.name} ended with {self._process.returncode}: {''.join(last)}")


def flown_to_the_end(log: np.ndarray) -> np.ndarray:
    """The log (flights, steps, 17) itself.

    Raises:
        VehicleLost: one was not; the message names the first.
    """
    has_attitude = np.linalg.norm(log[..., 3:7], axis=-1) > 0.5
    there = (np.isfinite(log).all(axis=-1) & has_attitude).all(axis=-1)
    if not there.all():
        raise VehicleLost(f"flight {np.argmin(there) + 1} of {len(log)} ended in numbers that no vehicle has")
    return log


def frame_of(published: dict[str, Any]) -> Airframe:
    """The vehicle as its owner knows it, of the Crazyflie's size and with the Crazyflie's pack."""
    mass, lever = published["mass"][0], published["L"][0]
    ix, iy, iz = (published["J"][axis][axis] for axis in range(3))
    thrust, torque = (np.polynomial.Polynomial(published[name][0]) for name in ("rpm2thrust", "rpm2torque"))
    highest = float(thrust(published["fastest"]))
    hover = speed_for(thrust.coef, mass * G / 4.0)
    up, up_square, down, down_square = published["rotor_dyn_coef"][0]
    # Of thrusts that go with the square of a speed, the one whose speed changes as much with the thrust.
    kf = float(thrust.deriv()(hover) / RPM) ** 2 / (mass * G)
    full = 4.1
    current = 25.0 / full * mass * G
    return Airframe(
        mass, lever * math.sqrt(2.0), ix, iy, iz,
        kf, math.sqrt(highest / kf),
        1.0 / (up + 2.0 * up_square * hover), 1.0 / (down + 2.0 * down_square * hover),
        float(torque.deriv()(hover) / thrust.deriv()(hover)),
        full, 0.15 * full, 450.0 * current, 0.08 * full / current, 25.0 / full,
    )  # fmt: skip


def speed_for(thrust: np.ndarray, force: float) -> float:
    """Speed (RPM) at which a published curve gives a force (N)."""
    c0, c1, c2 = thrust
    return float((-c1 + math.sqrt(c1 * c1 - 4.0 * c2 * (c0 - force))) / (2.0 * c2))


def draw_published_set(seed: int, folder: Path, room: PublishedRoom) -> DrawnSet:
    """Draw, fly and write the logs of a set into `folder`."""
    rng = np.random.default_rng([seed, 37])
    drone = str(rng.choice(list(room.drones)))
    published = room.drones[drone]
    frame = frame_of(published)
    integrator = str(rng.choice(list(LEADS)))
    lab = replace(  # its controller flies from the first step on
        draw_circumstances(rng, frame), integrator=integrator, rest=0.0
    )  # fmt: skip
    size = str(rng.choice(("weak", "medium", "strong")))
    hidden, effects, unlisted = hide_something(size, frame, lab, rng, KNOWN)
    flights, seconds = int(rng.choice(FLIGHTS)), float(rng.uniform(15.0, 40.0))
    kinds = [paths.KINDS[number % len(paths.KINDS)] for number in range(flights)]
    goals = np.stack([paths.draw_path(rng, kind, STEP, seconds, 0.0, 1.0) for kind in kinds])
    inertia = np.array([frame.ix, frame.iy, frame.iz])
    arrays = {
        "goals": goals,
        "gusts": np.stack([draw_gusts(frame, inertia, goals.shape[1], rng) for _ in kinds]) * lab.gust,
        "trim": inertia * rng.standard_normal((flights, 3)) * (0.5, 0.5, 0.2),
        "thrusts": 1.0 + 0.005 * rng.standard_normal(flights),
    }
    request = {
        "drone": drone,
        "integrator": integrator,
        "state_hz": int(rng.choice(STATE_RATES)),
        "attitude_hz": int(rng.choice((250, 500))),
        "hidden": asdict(hidden),
    }
    logs = room.fly(request, arrays)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, (kind, flown) in enumerate(zip(kinds, logs, strict=True)):
        own = np.random.default_rng([seed, 41, number])
        first = int(own.integers(lab.per_line))  # a log begins when somebody starts it
        log = as_logged(flown, np.array(published["rpm2thrust"][0]), frame, hidden)[first :: lab.per_line]
        files.append(folder / f"{kind}-{number + 1}.csv")
        write_log(files[-1], measured(log, hidden, lab, LEADS[integrator], own))
    answer = answer_of(size, flights, frame, lab, effects, unlisted)
    answer |= {"drone": drone, "state_hz": request["state_hz"]}
    return DrawnSet(files, owners_vehicle(drone, published), answer)


def owners_vehicle(drone: str, published: dict[str, Any]) -> Vehicle:
    """The vehicle file of who knows the published parameters, those of its rotors' inertia too."""
    inertia = {"rotor_inertia": Quantity(published["prop_inertia"][0], "kg m2", 0.0, "published")}
    rotors = tuple(
        Effect(name=name, parameters=inertia) for name in ("rotor_gyroscopic", "rotor_acceleration_torque")
    )
    return replace(nominal(frame_of(published), drone), effects=rotors)


def as_logged(flown: np.ndarray, thrust: np.ndarray, frame: Airframe, hidden: Hidden) -> np.ndarray:
    """A flight of the simulator (steps, 17) in the columns of a log (19).

    Cameras see a marker body that may sit and stand otherwise than the vehicle. Duties are for the speeds
    asked for, as a firmware finds them that knows the thrust of each speed and of each duty.
    """
    log = np.empty((len(flown), 19))
    log[:, 0] = np.arange(len(flown)) * STEP
    body = Rotation.from_quat(flown[:, 3:7])
    log[:, 1:4] = flown[:, :3] + body.apply(hidden.pose_offset)
    log[:, 4:8] = (body * Rotation.from_rotvec(hidden.pose_turn)).as_quat()
    log[:, 8:14] = flown[:, 7:13]
    forces = thrust[0] + thrust[1] * flown[:, 13:] + thrust[2] * flown[:, 13:] ** 2
    log[:, 14:18] = np.sqrt(np.clip(forces / frame.highest, 0.0, 1.0))
    log[:, 18] = frame.full_voltage
    return log
