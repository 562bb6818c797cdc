"""The same vehicle in MuJoCo: an independent referee for free flight and for landings.

Built from the parameters of our physics and from nothing else of it. Where the two differ on purpose:

- A leg has mass: a rod with half of `leg_mass` and a foot with the other half. The hull gives away as much
  mass and inertia, so that the vehicle at rest has the measured ones.
- The hip is a ball joint with a torsional spring and damper. A rod without torque about its own axis cannot
  twist, so this is the equally stiff hinge of docs/physics.md.
- The axial compliance of leg, pad and ceiling is a slide joint between rod and foot.
- A foot that reaches the ceiling is held by a `connect` constraint, a soft one of MuJoCo (two time steps).
- Hull and propellers touch through MuJoCo's soft contact, a spring and damper of the same restitution.
"""

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

MOTOR_SIGNS = ((1, -1), (-1, -1), (-1, 1), (1, 1))
"""Signs of x and y of motors M1..M4 and of the legs beside them."""

TURNS = (-1.0, 1.0, -1.0, 1.0)
"""Signs of the drag torque about b_z."""

CONTACT_TIME = 2e-3
"""s, time constant of the soft contact of the hull: an impact of 2 m/s goes about a millimetre deep."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RefereeSettings:
    """How finely MuJoCo runs, and what its legs weigh.

    Attributes:
        timestep: s.
        leg_mass: kg of one leg, half rod, half foot.
        integrator: MuJoCo's name of it.
        legs: whether there are legs at all.
    """

    timestep: float = 2e-5
    leg_mass: float = 1e-5
    integrator: str = "implicitfast"
    legs: bool = True


def _text(values: Any) -> str:
    return " ".join(f"{float(value):.17g}" for value in np.atleast_1d(values))


def _rod_inertia(mass: float, length: float) -> tuple[float, float]:
    """Inertia (kg m2) of a thin rod about its centre: across and, so that MuJoCo accepts it, along."""
    across = mass * length**2 / 12.0
    return across, 0.05 * across


def _leg_contribution(p: Any, settings: RefereeSettings) -> tuple[float, Floats, Floats]:
    """Mass (kg), centre (m) and inertia (kg m2, about the body origin) of the four legs at rest."""
    rod, length = 0.5 * settings.leg_mass, float(p["leg_length"])
    moment, inertia = np.zeros(3), np.zeros((3, 3))
    across, along = _rod_inertia(rod, length)
    for hip, u in zip(p["hip"], p["leg_direction"], strict=True):
        inertia += across * np.eye(3) + (along - across) * np.outer(u, u)
        for r in (hip + 0.5 * length * u, hip + length * u):
            moment += rod * r
            inertia += rod * (r @ r * np.eye(3) - np.outer(r, r))
    return 4.0 * settings.leg_mass, moment / (4.0 * settings.leg_mass), inertia


def _hull_inertial(p: Any, settings: RefereeSettings) -> str:
    """The hull's mass, centre and inertia: what is left of the measured ones without the legs."""
    mass, inertia, centre = float(p["mass"]), np.diag(p["inertia"]), np.zeros(3)
    if settings.legs:
        legs, legs_centre, legs_inertia = _leg_contribution(p, settings)
        mass -= legs
        centre = -legs * legs_centre / mass
        shift = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        inertia = inertia - legs_inertia - shift
    full = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return f'<inertial pos="{_text(centre)}" mass="{mass:.17g}" fullinertia="{_text(full)}"/>'


def _leg(p: Any, index: int, settings: RefereeSettings) -> str:
    """Rod on a ball joint, foot on a slide joint."""
    length, half = float(p["leg_length"]), 0.5 * settings.leg_mass
    u = np.asarray(p["leg_direction"][index])
    across, along = _rod_inertia(half, length)
    # The rod's own z axis points from hip to foot.
    axis = np.cross([0.0, 0.0, 1.0], u)
    angle = math.atan2(float(np.linalg.norm(axis)), float(u[2]))
    axis = axis / np.linalg.norm(axis)
    quaternion = (math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis))
    tiny = 1e-3 * across
    return f"""
    <body name="rod{index}" pos="{_text(p["hip"][index])}" quat="{_text(quaternion)}">
      <joint name="hip{index}" type="ball" stiffness="{_text(p["hinge_stiffness"])}"
             damping="{_text(p["hinge_damping"])}"/>
      <inertial pos="0 0 {0.5 * length:.17g}" mass="{half:.17g}"
                diaginertia="{_text((across, across, along))}"/>
      <body name="foot{index}" pos="0 0 {length:.17g}">
        <joint name="axial{index}" type="slide" axis="0 0 1" stiffness="{_text(p["axial_stiffness"])}"
               damping="{_text(p["axial_damping"])}"/>
        <inertial pos="0 0 0" mass="{half:.17g}" diaginertia="{_text((tiny, tiny, tiny))}"/>
      </body>
    </body>"""


def vehicle_mjcf(p: Any, settings: RefereeSettings) -> str:
    """The vehicle under its ceiling as MJCF; `p` is a record of our PARAMETERS without drag."""
    arms = [(x * float(p["arm_x"]), y * float(p["arm_y"])) for x, y in MOTOR_SIGNS]
    top, bottom = float(p["body_top_z"]), float(p["body_bottom_z"])
    half = (p["body_half_x"], p["body_half_y"], 0.5 * (top - bottom))
    sites = "".join(f'<site name="m{k}" pos="{_text((*arm, 0.0))}"/>' for k, arm in enumerate(arms))
    discs = "".join(
        f'<geom type="cylinder" size="{_text((p["propeller_radius"], 1e-4))}" '
        f'pos="{_text((*arm, p["propeller_height_z"] - 1e-4))}"/>'
        for arm in arms
    )
    legs = "".join(_leg(p, k, settings) for k in range(4)) if settings.legs else ""
    holds = "".join(
        f'<connect name="hold{k}" body1="foot{k}" anchor="0 0 0" active="false" '
        f'solref="{2.0 * settings.timestep:.17g} 1" solimp="0.9999 0.9999 0.001"/>'
        for k in range(4)
    )
    motors = "".join(
        f'<motor site="m{k}" gear="0 0 1 0 0 {turn * float(p["thrust_to_torque"]):.17g}"/>'
        for k, turn in enumerate(TURNS)
    )
    bounce = -math.log(float(p["restitution"])) / math.hypot(math.pi, math.log(float(p["restitution"])))
    surface = f'solref="{CONTACT_TIME:.17g} {bounce:.17g}" friction="{_text(p["friction"])} 0 0"'
    return f"""
<mujoco>
  <compiler autolimits="true" balanceinertia="false"/>
  <option timestep="{settings.timestep:.17g}" integrator="{settings.integrator}"
          gravity="0 0 {-float(p["gravity"]):.17g}" cone="elliptic" tolerance="1e-12" iterations="100">
    <flag energy="enable" autoreset="disable"/>
  </option>
  <default><geom contype="1" conaffinity="2" condim="3" {surface}/></default>
  <worldbody>
    <geom name="ceiling" type="box" size="50 50 0.5" pos="0 0 {float(p["ceiling_z"]) + 0.5:.17g}"
          contype="2" conaffinity="1"/>
    <body name="hull">
      <freejoint/>
      {_hull_inertial(p, settings)}
      <geom type="box" size="{_text(half)}" pos="0 0 {0.5 * (top + bottom):.17g}"/>
      {discs}{sites}{legs}
    </body>
  </worldbody>
  <equality>{holds if settings.legs else ""}</equality>
  <actuator>{motors}</actuator>
</mujoco>"""


class Referee:
    """One vehicle in MuJoCo, with the feet's adhesion and the hinges' stops that MJCF cannot say.

    Attributes:
        position, velocity: m, m/s, world. omega: rad/s, body frame.
        attached: which feet hold.
        impact_time, body_contact_time: s, `inf` before.
    """

    def __init__(self, p: Any, settings: RefereeSettings) -> None:
        if np.any(p["drag"]):
            raise ValueError("the referee has no drag")
        self.p, self.settings = p, settings
        self.model = mujoco.MjModel.from_xml_string(vehicle_mjcf(p, settings))
        self.data = mujoco.MjData(self.model)
        self.attached = np.zeros(4, dtype=bool)
        self.impact_time = self.body_contact_time = math.inf
        self.position, self.velocity = self.data.qpos[:3], self.data.qvel[:3]
        self.omega = self.data.qvel[3:6]
        self._foot_z_touch = float(p["ceiling_z"] - p["foot_radius"])
        if settings.legs:
            names = [f"foot{k}" for k in range(4)]
            self._feet = [mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name) for name in names]
            joints = [mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, f"hip{k}") for k in range(4)]
            self._hip_q = [int(self.model.jnt_qposadr[j]) for j in joints]
            self._hip_v = [int(self.model.jnt_dofadr[j]) for j in joints]

    @property
    def quaternion(self) -> Floats:
        """Attitude, body to world, scalar-last."""
        w, x, y, z = self.data.qpos[3:7]
        return np.array([x, y, z, w])

    @property
    def energy(self) -> float:
        """Kinetic, potential (zero at the floor) and spring energy (J)."""
        mujoco.mj_forward(self.model, self.data)
        return float(self.data.energy.sum())

    def place(self, state: Any) -> None:
        """Take place, attitude and velocities from a record of our STATE with free legs."""
        d = self.data
        x, y, z, w = state["quaternion"]
        d.qpos[:7] = [*state["position"], w, x, y, z]
        d.qvel[:6] = [*state["velocity"], *state["omega"]]
        d.time = float(state["time"])
        mujoco.mj_forward(self.model, d)

    def step(self, thrusts: Any) -> None:
        """One time step with constant thrusts (N, M1..M4)."""
        d = self.data
        d.ctrl[:] = thrusts
        if self.settings.legs:
            self._stops()
        mujoco.mj_step(self.model, d)
        if d.warning.number.any():
            raise FloatingPointError(f"MuJoCo became unstable at {d.time:g} s: take a smaller timestep")
        if d.ncon and self.body_contact_time == math.inf:
            self.body_contact_time = float(d.time)
        if self.settings.legs and self.position[2] > self._foot_z_touch - float(self.p["reach"]):
            self._touch()
        if self.impact_time == math.inf:
            self.impact_time = self.body_contact_time

    def _stops(self) -> None:
        """Moments of the hinges' stops, which MJCF would make softer or harder with the legs' inertia."""
        d, limit = self.data, float(self.p["hinge_limit"])
        cosine = math.cos(0.5 * limit)
        d.qfrc_applied[:] = 0.0
        if np.abs(d.qpos[self._hip_q]).min() >= cosine:
            return
        for q, v in zip(self._hip_q, self._hip_v, strict=True):
            w = abs(d.qpos[q])
            if w >= cosine:
                continue
            axis = d.qpos[q + 1 : q + 4] * math.copysign(1.0, d.qpos[q])
            angle = 2.0 * math.acos(min(w, 1.0))
            moment = float(self.p["hinge_limit_stiffness"]) * (angle - limit)
            d.qfrc_applied[v : v + 3] = -moment * axis / np.linalg.norm(axis)

    def _touch(self) -> None:
        """Hold the feet that reached the ceiling where they are."""
        d = self.data
        mujoco.mj_kinematics(self.model, d)
        for k, body in enumerate(self._feet):
            if self.attached[k] or d.xpos[body, 2] < self._foot_z_touch:
                continue
            self.attached[k] = True
            self.model.eq_data[k, 0:3] = 0.0
            self.model.eq_data[k, 3:6] = d.xpos[body]
            d.eq_active[k] = 1
            self.impact_time = min(self.impact_time, float(d.time))
