"""Landing attempts flown by our physics and by MuJoCo, from one start and with one history of thrusts."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.mixer import Thrusts, flip_thrusts
from onboard.outcome import Outcome
from onboard.rotation import body_x, body_z
from sim_backend.physics.outcome import classify
from sim_backend.physics.reset import approaching
from sim_backend.physics.step import step_thrust
from tests.physics.energy import mechanical_energy
from tests.physics.mujoco_vehicle import Referee, RefereeSettings

OFF: Thrusts = (0.0, 0.0, 0.0, 0.0)
SAMPLE = 1e-3
"""s between two rows of a history."""


@dataclass(frozen=True)
class Attempt:
    """An approach and the flip.

    Attributes:
        speed: m/s. angle_deg: above the horizon.
        tau: s, velocity times this is the distance from the body origin to the ceiling at the trigger.
        moment: N m, nose up.
        crooked: adds a roll, a yaw, a drift to the side and unequal front motors.
    """

    speed: float
    angle_deg: float
    tau: float
    moment: float
    crooked: bool = False

    def start(self, p: Any) -> Any:
        """The state at the trigger: level, hover thrust."""
        angle = math.radians(self.angle_deg)
        velocity = np.array([self.speed * math.cos(angle), 0.0, self.speed * math.sin(angle)])
        state = approaching(p, np.array([0.0, 0.0, float(p["ceiling_z"]) - self.tau * velocity[2]]), velocity)
        if self.crooked:
            state["velocity"][1], state["omega"] = 0.25, [0.6, 0.0, 0.4]
        return state

    def thrusts(self, p: Any) -> Thrusts:
        """What the motors head for until they are cut (N)."""
        front_right, back_right, back_left, front_left = flip_thrusts(-self.moment, float(p["arm_x"]))
        return (front_right * (1.02 if self.crooked else 1.0), back_right, back_left, front_left)


@dataclass(frozen=True)
class History:
    """What happened, sampled every millisecond.

    Attributes:
        time: (n,) s. position: (n, 3) m. omega: (n, 3) rad/s, body frame.
        swing: (n,) rad, direction of the nose in the vertical plane, continuous.
        energy: (n,) J, mechanical, with the springs.
        impact_time, body_contact_time: s, `inf` without.
        cut: s, when the motors were cut.
        outcome: at the end.
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    omega: NDArray[np.float64]
    swing: NDArray[np.float64]
    energy: NDArray[np.float64]
    impact_time: float
    body_contact_time: float
    cut: float
    outcome: Outcome

    @property
    def peak_rate(self) -> float:
        """Largest pitch rate (rad/s) from the impact on."""
        return float(np.max(np.abs(self.omega[self.time >= self.impact_time, 1])))


def _sample(time: float, vehicle: Any, energy: float) -> list[float]:
    read = vehicle.__getitem__ if isinstance(vehicle, np.void) else vehicle.__getattribute__
    nose = body_x(read("quaternion"))
    return [time, *read("position"), *read("omega"), math.atan2(nose[2], nose[0]), energy]


def _history(rows: list[list[float]], impact: float, contact: float, cut: float, feet: int) -> History:
    table = np.array(rows)
    return History(
        time=table[:, 0],
        position=table[:, 1:4],
        omega=table[:, 4:7],
        swing=np.unwrap(table[:, 7]),
        energy=table[:, 8],
        impact_time=impact,
        body_contact_time=contact,
        cut=cut,
        outcome=classify(feet, math.isfinite(contact)),
    )


def fly_ours(p: Any, attempt: Attempt, dt: float, duration: float = 0.7, cut: float | None = None) -> History:
    """Our physics; without `cut` (s) the motors stop when the body axis falls below the horizon."""
    state, thrusts = attempt.start(p), attempt.thrusts(p)
    every, rows = round(SAMPLE / dt), []
    for k in range(round(duration / dt)):
        if cut is None and body_z(state["quaternion"])[2] <= 0.0:
            cut = float(state["time"])
        # The time is a sum of steps: half a step decides it safely.
        running = cut is None or k * dt < cut - 0.5 * dt
        step_thrust(state, p, thrusts if running else OFF, dt)
        if (k + 1) % every == 0:
            rows.append(_sample(float(state["time"]), state, mechanical_energy(state, p)))
    impact, contact = float(state["impact_time"]), float(state["body_contact_time"])
    return _history(rows, impact, contact, cut or math.inf, int(state["foot_attached"].sum()))


def fly_referee(
    p: Any, attempt: Attempt, cut: float, settings: RefereeSettings, duration: float = 0.7
) -> History:
    """MuJoCo, with the motors' lag solved exactly at the middle of every step."""
    referee = Referee(p, settings)
    start = attempt.start(p)
    referee.place(start)
    dt, thrust = settings.timestep, np.array(start["thrust"])
    running, off = np.array(attempt.thrusts(p)), np.zeros(4)
    every, rows = round(SAMPLE / dt), []
    for k in range(round(duration / dt)):
        target = running if k * dt < cut - 0.5 * dt else off
        middle = lagged(p, thrust, target, 0.5 * dt)
        referee.step(middle)
        thrust = lagged(p, middle, target, 0.5 * dt)
        if (k + 1) % every == 0:
            rows.append(_sample(float(referee.data.time), referee, referee.energy))
    return _history(
        rows, referee.impact_time, referee.body_contact_time, cut, int(np.count_nonzero(referee.attached))
    )


def lagged(
    p: Any, thrust: NDArray[np.float64], target: NDArray[np.float64], dt: float
) -> NDArray[np.float64]:
    """Thrusts (N) after `dt` (s): first order, with one time constant up and one down."""
    up, down = math.exp(-dt / p["time_constant_up"]), math.exp(-dt / p["time_constant_down"])
    error = thrust - target
    return target + error * np.where(error < 0.0, up, down)
