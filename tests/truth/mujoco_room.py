"""A room in MuJoCo: its integrators, its drag and wind, its accelerometer, gyro and tracked frames.

What is hidden in a vehicle is said to MuJoCo in MuJoCo's own words where it has them: masses, centres and
inertias of the body, the turn of the rotors' sites, viscosity, density and wind of the medium, the place and
the turn of the site that cameras see. Rotors, battery, pilot and noise are this program's own.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from scipy.signal import lfilter

from tests.truth.airframe import Airframe, G
from tests.truth.pilots import steer

Array = np.ndarray
STEP = 1e-3
"""s, of the integrator."""
SIGNS = ((1, -1), (-1, -1), (-1, 1), (1, 1))
"""Of x and y of the rotors M1 to M4."""
TURNS = (-1.0, 1.0, -1.0, 1.0)
"""Of the rotors' torques about the body's z axis."""
AIR = 1.2
"""kg/m3, for which areas are said."""
STANDS = 0.45
"""Half height of the hull in arms: how high the body's origin stands on the floor."""


@dataclass(frozen=True)
class Circumstances:
    """What one lab chose, and another would have chosen otherwise.

    Attributes:
        integrator: MuJoCo's name of it.
        pilot: of `pilots`; ticks: steps between two of its turns.
        per_line: steps between two lines of the log; phase: steps before its first.
        speed_law: rotors follow in speed (else in thrust).
        compensated: the pilot corrects its duty for the voltage.
        battery_lag: s, with which the voltage follows the current.
        accelerometer, voltage: whether the log has them.
        rest: s on the floor before take-off, 0: the log begins in the air.
        gust: of the air's pushes, in units of a calm room's.
        pose_noise, angle_noise: m and rad, of the cameras.
    """

    integrator: str
    pilot: int
    ticks: int
    per_line: int
    phase: int
    speed_law: bool
    compensated: bool
    battery_lag: float
    accelerometer: bool
    voltage: bool
    rest: float
    gust: float
    pose_noise: float
    angle_noise: float


@dataclass(frozen=True)
class Hidden:
    """How the vehicle that flies differs from its file; SI units, each as the effect of a vehicle file."""

    thrust_scale: float = 1.0
    motors: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    lag_scale: float = 1.0
    lag_ratio: float = 1.0
    delay: float = 0.0
    resistance: float = 0.0
    mass: float = 0.0
    inertia: tuple[float, ...] = (0.0, 0.0, 0.0)
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)
    lean: tuple[float, ...] = (0.0, 0.0)
    linear_drag: float = 0.0
    area: float = 0.0
    wind: tuple[float, ...] = (0.0, 0.0, 0.0)
    velocity_moment: tuple[float, ...] = (0.0, 0.0)
    rate_damping: tuple[float, ...] = (0.0, 0.0, 0.0)
    pose_delay: float = 0.0
    pose_turn: tuple[float, ...] = (0.0, 0.0, 0.0)
    pose_offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    gyro_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
    slab: tuple[float, ...] = (0.0, 0.0, 0.0)
    """Push along y (m/s2) where x lies between the two others (m): no effect has it."""
    line: tuple[float, ...] = (0.0, 0.0, 0.0)
    """Angular acceleration (rad/s2) about b_x and b_y and its frequency (Hz): no effect has it."""


def _text(values: Any) -> str:
    return " ".join(f"{float(value):.12g}" for value in np.atleast_1d(values))


def _quaternion(vector: tuple[float, ...]) -> Array:
    """Quaternion (scalar first) of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    axis = np.asarray(vector) / angle if angle else np.zeros(3)
    return np.array([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis)])


def build(frame: Airframe, hidden: Hidden, integrator: str, viscosity: float, density: float) -> Any:
    """MuJoCo's model of the room and of the vehicle that flies in it."""
    lever = frame.arm / math.sqrt(2.0)
    inertia = np.array([frame.ix, frame.iy, frame.iz]) * (1.0 + np.array(hidden.inertia))
    axis = (math.tan(hidden.lean[0]), math.tan(hidden.lean[1]), 1.0)
    rotors = "".join(
        f'<site name="m{k}" pos="{_text((x * lever, y * lever, 0.0))}" zaxis="{_text(axis)}"/>'
        for k, (x, y) in enumerate(SIGNS)
    )
    turn = _text(_quaternion(hidden.pose_turn))
    actuators = "".join(
        f'<motor site="m{k}" gear="0 0 1 0 0 {sense * frame.yaw_lever:.9g}"/>'
        for k, sense in enumerate(TURNS)
    )
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="{STEP}" integrator="{integrator}" gravity="0 0 {-G}" viscosity="{viscosity:.9g}"
              density="{density:.9g}" wind="{_text(hidden.wind)}"/>
      <worldbody>
        <geom type="plane" size="50 50 1"/>
        <body name="hull" pos="0 0 1">
          <freejoint/>
          <inertial pos="{_text(hidden.centre)}" mass="{frame.mass * (1.0 + hidden.mass):.9g}"
                    diaginertia="{_text(inertia)}"/>
          <geom type="box" size="{_text((lever, lever, STANDS * frame.arm))}"/>
          <site name="imu"/>
          <site name="marker" pos="{_text(hidden.pose_offset)}" quat="{turn}"/>
          {rotors}
        </body>
      </worldbody>
      <actuator>{actuators}</actuator>
      <sensor>
        <framepos objtype="site" objname="marker"/><framequat objtype="site" objname="marker"/>
        <gyro site="imu"/><accelerometer site="imu"/>
      </sensor>
    </mujoco>""")


def room(frame: Airframe, hidden: Hidden, integrator: str) -> tuple[Any, Array]:
    """The model whose medium drags as `hidden` says, and how its viscosity damps rates (3, N m s/rad)."""
    viscous, dense = (_drag(frame, hidden, *medium) for medium in ((1.0, 0.0), (0.0, 1.0)))
    viscosity, density = hidden.linear_drag / viscous[0], 0.5 * AIR * hidden.area / dense[0]
    return build(frame, hidden, integrator, viscosity, density), viscosity * viscous[3:]


def faces_of(frame: Airframe, hidden: Hidden) -> Array:
    """How the area that the air meets along each body axis goes with that along b_x (3,)."""
    drag = _drag(frame, hidden, 0.0, 1.0)
    return drag[:3] / drag[0]


def _drag(frame: Airframe, hidden: Hidden, viscosity: float, density: float) -> Array:
    """What MuJoCo's medium does at 1 m/s along and 1 rad/s about each axis (6, N and N m).

    It follows from the box that has the body's inertia.
    """
    model = build(frame, replace(hidden, wind=(0.0, 0.0, 0.0)), "Euler", viscosity, density)
    data = mujoco.MjData(model)
    pull = np.empty(6)
    for axis in range(6):
        data.qvel[:] = 0.0
        data.qvel[axis] = 1.0
        mujoco.mj_forward(model, data)
        pull[axis] = -data.qfrc_fluid[axis]
    return pull


class _Rotors:
    """Thrusts that follow the duties, through delay, battery and lag."""

    def __init__(self, frame: Airframe, hidden: Hidden, lab: Circumstances, gain: float, used: float) -> None:
        self.frame, self.lab = frame, lab
        self.gain = gain * hidden.thrust_scale * np.array(hidden.motors)
        root = math.sqrt(hidden.lag_ratio)
        self.up = frame.lag_up * hidden.lag_scale / root
        self.down = frame.lag_down * hidden.lag_scale * root
        self.resistance = frame.resistance + hidden.resistance
        self.waiting = [np.zeros(4)] * (round(hidden.delay / STEP) + 1)
        self.thrust, self.used, self.current = np.zeros(4), used, 0.0

    @property
    def voltage(self) -> float:
        """At the terminals, V."""
        frame = self.frame
        if not self.lab.voltage:
            return frame.full_voltage
        return frame.full_voltage - frame.slope * self.used / frame.capacity - self.resistance * self.current

    def step(self, duty: Array) -> Array:
        """Thrusts (N) that act in the next step."""
        frame, lab = self.frame, self.lab
        self.waiting.append(duty)
        wanted = self.gain * frame.highest * (self.waiting.pop(0) * self.voltage / frame.full_voltage) ** 2
        now, goal = (np.sqrt(self.thrust), np.sqrt(wanted)) if lab.speed_law else (self.thrust, wanted)
        keep = np.where(goal > now, math.exp(-STEP / self.up), math.exp(-STEP / self.down))
        now = goal + (now - goal) * keep
        self.thrust = now * now if lab.speed_law else now
        drawn = frame.per_newton * float((self.thrust / self.gain).sum())
        self.current += (drawn - self.current) * (1.0 - math.exp(-STEP / max(lab.battery_lag, 1e-6)))
        self.used += STEP * drawn
        return self.thrust


def fly(frame: Airframe, hidden: Hidden, lab: Circumstances, goals: Array, rng: np.random.Generator) -> Array:
    """One flight along `goals`, one a step.

    Lines of the log: time, place, quaternion, rate, specific force, four duties, voltage (19 columns).
    """
    model, damping = room(frame, hidden, lab.integrator)
    data = mujoco.MjData(model)
    data.qpos[2] = STANDS * frame.arm if lab.rest else goals[0, 2]
    rotors = _Rotors(
        frame, hidden, lab, 1.0 + 0.005 * rng.standard_normal(), 0.3 * rng.random() * frame.capacity
    )
    inertia = np.array([frame.ix, frame.iy, frame.iz])
    told = np.array([frame.mass, frame.arm, *inertia, frame.yaw_lever, frame.highest, frame.lag_up])
    trim = inertia * rng.standard_normal(3) * (0.5, 0.5, 0.2)
    gusts = draw_gusts(frame, inertia, len(goals), rng) * lab.gust
    duty, total = np.zeros(4), np.zeros(3)
    if not lab.rest:
        duty += math.sqrt(frame.mass * G / 4.0 / frame.highest)
        rotors.waiting = [duty] * len(rotors.waiting)
        rotors.thrust = np.full(4, frame.mass * G / 4.0)
    log = np.empty((-(-(len(goals) - lab.phase) // lab.per_line), 19))
    for k, goal in enumerate(goals):
        if k % lab.ticks == 0 and k * STEP >= lab.rest:
            pose, velocity = data.qpos.copy(), data.qvel.copy()
            wanted = steer(lab.pilot, told, pose, velocity, goal, total, lab.ticks * STEP)
            ratio = frame.full_voltage / rotors.voltage if lab.compensated else 1.0
            duty = np.minimum(np.sqrt(wanted / frame.highest) * ratio, 1.0)
        data.ctrl[:] = rotors.step(duty)
        _push(data, frame, hidden, inertia, gusts[k], trim, damping, k * STEP)
        mujoco.mj_step(model, data)
        line, over = divmod(k - lab.phase, lab.per_line)
        if over == 0 and line >= 0:
            seen = data.sensordata
            log[line] = [k * STEP, *seen[0:3], *seen[4:7], seen[3], *seen[7:13], *duty, rotors.voltage]
    return measured(log, hidden, lab, pose_lead(lab.integrator), rng)


def _push(
    data: Any,
    frame: Airframe,
    hidden: Hidden,
    inertia: Array,
    gust: Array,
    trim: Array,
    damping: Array,
    t: float,
) -> None:
    """Forces (world) and torques (body) that MuJoCo has no word for; it takes them at the body's origin.

    The `damping` of rates that its viscosity brings is taken back: `rate_damping` alone says what there is.
    """
    force, torque = gust[:3].copy(), gust[3:] + (trim if t > 0.0 else 0.0)
    if hidden.slab[1] < data.qpos[0] < hidden.slab[2]:
        force[1] += frame.mass * hidden.slab[0]
    if hidden.line[2]:
        turning = math.sin(2.0 * math.pi * hidden.line[2] * t)
        torque[:2] += inertia[:2] * np.array(hidden.line[:2]) * turning
    if any(hidden.velocity_moment):
        across = np.empty(9)
        mujoco.mju_quat2Mat(across, data.qpos[3:7])
        u = across.reshape(3, 3).T @ (data.qvel[0:3] - np.array(hidden.wind))
        torque[0] += hidden.velocity_moment[0] * u[1]
        torque[1] -= hidden.velocity_moment[1] * u[0]
    torque -= (np.array(hidden.rate_damping) - damping) * data.qvel[3:6]
    data.qfrc_applied[:3], data.qfrc_applied[3:] = force, torque


def draw_gusts(frame: Airframe, inertia: Array, count: int, rng: np.random.Generator) -> Array:
    """Ornstein-Uhlenbeck pushes (N) and turns (N m); a heavy vehicle is turned less."""
    turning = 2.0 * (0.03 / frame.mass) ** 0.4
    gusts = np.empty((count, 6))
    gusts[:, :3] = 0.06 * frame.mass * _coloured(rng, count, 0.4)
    gusts[:, 3:] = inertia * np.array([turning, turning, 0.3 * turning]) * _coloured(rng, count, 0.06)
    return gusts


def _coloured(rng: np.random.Generator, count: int, time: float) -> Array:
    keep = math.exp(-STEP / time)
    return np.asarray(
        lfilter([math.sqrt(1.0 - keep * keep)], [1.0, -keep], rng.standard_normal((count, 3)), axis=0)
    )


def pose_lead(integrator: str) -> float:
    """Time (s) that poses are ahead of the velocities beside them: half a step where a pose moves by the
    velocity at its step's end, as in MuJoCo's integrators but Runge and Kutta's."""
    return 0.0 if integrator == "RK4" else 0.5 * STEP


def measured(log: Array, hidden: Hidden, lab: Circumstances, lead: float, rng: np.random.Generator) -> Array:
    """The log with delays, biases and noise; NaN for what this lab does not measure.

    `lead` is by how much (s) the poses of the log are ahead of what stands beside them.
    """
    seen = log.copy()
    late = hidden.pose_delay + lead
    for column in range(1, 8):
        seen[:, column] = np.interp(log[:, 0] - late, log[:, 0], log[:, column])
    count = len(log)
    seen[:, 1:4] += lab.pose_noise * rng.standard_normal((count, 3))
    half = 0.5 * lab.angle_noise * rng.standard_normal((count, 3))
    x, y, z, w = seen[:, 4:8].T
    a, b, c = half.T
    seen[:, 4:8] = np.column_stack(
        [
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
            w - x * a - y * b - z * c,
        ]
    )
    seen[:, 4:8] /= np.linalg.norm(seen[:, 4:8], axis=1, keepdims=True)
    seen[:, 8:11] += np.array(hidden.gyro_bias) + 2e-3 * rng.standard_normal((count, 3))
    seen[:, 11:14] += 0.03 * rng.standard_normal(3) + 0.08 * rng.standard_normal((count, 3))
    seen[:, 14:18] = np.round(65535.0 * log[:, 14:18])
    seen[:, 18] += 0.005 * rng.standard_normal(count)
    if not lab.accelerometer:
        seen[:, 11:14] = np.nan
    if not lab.voltage:
        seen[:, 18] = np.nan
    return seen
