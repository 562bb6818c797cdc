"""Landings from the physics: what a mocap and a gyro would have seen, and what was true."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.flights import Flight, PoseSource, Trigger
from calibration.flights.flight import finite_masks
from onboard.controller import DEFAULT_GAINS
from onboard.mixer import flip_thrusts
from onboard.room import RoomGeometry
from onboard.rotation import body_z
from onboard.vehicle import Vehicle
from perchhw.attempt import Outcome
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import charged
from sim_backend.physics.rollout import hold_velocity, limited, place
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step_thrust
from tests.physics.outcome import landing_outcome

CHANNELS = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "gx", "gy", "gz")


@dataclass(frozen=True)
class Landing:
    """A simulated attempt: its flight at 100 Hz and its true outcome."""

    flight: Flight
    truth: Outcome
    n_feet: int


def land(
    vehicle: Vehicle,
    speed: float,
    angle_deg: float,
    tau_critical: float,
    a_rot: float,
    rng: np.random.Generator,
    seconds_after_trigger: float = 2.5,
) -> Landing:
    """Approach, flip at `tau_critical` (s) with `a_rot` (N m), cut at 90 deg, rest; with 0.5 mm of noise."""
    room = RoomGeometry()
    p = physics_parameters(vehicle, room)
    state = charged(new_state(), p)
    angle = math.radians(angle_deg)
    held = (speed * math.cos(angle), 0.0, speed * math.sin(angle))
    place(state, p, held, 0.7, 1.0)
    rows: list[list[float]] = []
    trigger_t: float | None = None
    cut = False
    lagged = (0.0, 0.0, 0.0)
    count = 0
    while trigger_t is None or state["time"] < trigger_t + seconds_after_trigger:
        tau = (room.ceiling_z - state["position"][2]) / max(state["velocity"][2], 1e-6)
        if count % 10 == 0:
            rows.append([*state["position"], *state["quaternion"], *state["velocity"], *state["omega"]])
            if trigger_t is None and tau <= tau_critical:
                trigger_t = float(state["time"])
        if trigger_t is None:
            targets, lagged = hold_velocity(state, p, state["velocity"], held, DEFAULT_GAINS, lagged, 1e-3)
        else:
            cut = cut or body_z(state["quaternion"])[2] <= 0.0
            thrusts = (0.0, 0.0, 0.0, 0.0) if cut else flip_thrusts(a_rot, p["arm_x"])
            targets = limited(thrusts, p["thrust_max"])
        step_thrust(state, p, targets, 1e-3)
        count += 1
    values = np.array(rows)
    values[:, :3] += rng.normal(0.0, 0.5e-3, (len(rows), 3))
    values[:, 3:7] += rng.normal(0.0, math.radians(0.1), (len(rows), 4))
    values[:, 3:7] /= np.linalg.norm(values[:, 3:7], axis=1, keepdims=True)
    data = dict(zip(CHANNELS, values.T.copy(), strict=True))
    flight = Flight(
        name="simulated",
        source=Path("simulated"),
        format="table",
        pose_source=PoseSource.MOCAP,
        t=np.arange(len(rows)) * 0.01,
        data=data,
        valid=finite_masks(data),
        trigger=Trigger(trigger_t),
        ceiling_z=room.ceiling_z,
    )
    return Landing(flight, landing_outcome(state), int(state["foot_attached"].sum()))
