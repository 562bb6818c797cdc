"""crazyflow as a flight room: it flies vehicles in which something is hidden, with its own controller.

Runs in a Python that has crazyflow (see docs/physics.md) and without perchhw. It prints `{"ready": ...}` with
the parameters of its vehicles, then flies one set for each line on standard input, and ends with its input.

A line: `drone`, `integrator`, `state_hz` and `attitude_hz` (of the controller's loops), `input`, `output` and
what is `hidden`. `input` (npz): `goals`
(flights, steps, 10: place, velocity, acceleration, heading), `gusts` (flights, steps, 6: force in the world,
torque in the body), `trim` (flights, 3, N m), `thrusts` (flights,). `output` (npz): `log` (flights, steps,
17: place, quaternion x y z w, rates, specific force, rotor speeds that the controller asks for in RPM).
"""

import os

os.environ["JAX_PLATFORMS"] = "cpu"
os.environ["JAX_ENABLE_X64"] = "1"

import json
import sys
from functools import partial
from importlib.metadata import version
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from crazyflow.sim import Sim, functional
from crazyflow.sim.dynamics import first_principles_dynamics
from crazyflow.sim.pipeline import insert_fn_after
from jax.scipy.spatial.transform import Rotation

DRONES = ("cf2x_L250", "cf2x_P250", "cf2x_T350", "cf21B_500")
"""Those that its dynamics of first principles know."""
HERTZ = 1000
G = 9.81
PARAMETERS = ("mass", "L", "prop_inertia", "J", "rpm2thrust", "rpm2torque", "rotor_dyn_coef")


def published(drone: str) -> dict[str, Any]:
    """Parameters of one vehicle and the speeds (RPM) that its rotors are kept within."""
    sim = Sim(drone=drone, dynamics="first_principles", freq=HERTZ, device="cpu")
    clip = sim.step_pipeline["clip_rotor_vel_cmd"].keywords
    told = {name: np.asarray(getattr(sim.data.params, name)).tolist() for name in PARAMETERS}
    return {**told, "slowest": float(clip["lower"]), "fastest": float(clip["upper"])}


def build(request: dict[str, Any], thrusts: np.ndarray) -> Sim:
    """A world for each flight, all with the hidden vehicle, whose commands arrive late."""
    hidden = request["hidden"]
    sim = Sim(
        n_worlds=len(thrusts), drone=request["drone"], dynamics="first_principles", control="state",
        integrator=request["integrator"], freq=HERTZ, state_freq=request["state_hz"],
        attitude_freq=request["attitude_hz"], force_torque_freq=HERTZ, device="cpu",
    )  # fmt: skip
    p = sim.data.params
    motors = np.array(hidden["motors"]) * hidden["thrust_scale"]
    strength = jnp.asarray(thrusts[:, None, None, None] * motors[:, None])  # (flights, 1, 4, 1)
    root = np.sqrt(hidden["lag_ratio"])
    quicker = np.array([root, root, 1.0 / root, 1.0 / root]) / hidden["lag_scale"]
    turned = jnp.diag(1.0 + jnp.asarray(hidden["inertia"])) @ p.J
    changed = p.replace(
        mass=p.mass * (1.0 + hidden["mass"]),
        J=turned,
        J_inv=jnp.linalg.inv(turned),
        rpm2thrust=p.rpm2thrust * strength,
        rpm2torque=p.rpm2torque * strength,
        rotor_dyn_coef=p.rotor_dyn_coef * quicker,
        drag_matrix=-hidden["linear_drag"] * jnp.eye(3),
    )
    late = round(hidden["delay"] * HERTZ)

    def delayed(data: Any) -> Any:
        """What the controller asks for now is kept; what it asked for `late` steps ago acts."""
        asked = data.controls.rotor_vel
        waiting = jnp.concatenate([data.plugins["waiting"], asked[None]])
        controls = data.controls.replace(rotor_vel=waiting[0])
        return data.replace(controls=controls, plugins={"waiting": waiting[1:], "asked": asked})

    insert_fn_after(sim.step_pipeline, "clip_rotor_vel_cmd", delayed, "delayed")
    hover = _hover(p)
    turning = jnp.full((len(thrusts), 1, 4), hover)
    sim.data = sim.data.replace(
        params=changed,
        plugins={"waiting": jnp.tile(turning, (late, 1, 1, 1)), "asked": turning},
    )
    return sim


def _hover(p: Any) -> float:
    """Speed (RPM) at which four published rotors carry the published mass."""
    c0, c1, c2 = (float(c) for c in np.ravel(p.rpm2thrust))
    return float((-c1 + np.sqrt(c1 * c1 - 4.0 * c2 * (c0 - float(p.mass[0]) * G / 4.0))) / (2.0 * c2))


def pushed(data: Any, hidden: dict[str, Any], masses: tuple[float, np.ndarray], gust: Any, t: Any) -> Any:
    """The data with the forces (world) and torques that its parameters have no word for."""
    mass, inertia = masses
    body = Rotation.from_quat(data.states.quat)
    force, torque = gust[..., :3], gust[..., 3:]
    low, high = hidden["slab"][1:]
    inside = (data.states.pos[..., 0] > low) & (data.states.pos[..., 0] < high)
    force = force.at[..., 1].add(jnp.where(inside, mass * hidden["slab"][0], 0.0))
    force = force + hidden["linear_drag"] * jnp.asarray(hidden["wind"])
    swing = jnp.sin(2.0 * jnp.pi * hidden["line"][2] * t)
    torque = torque.at[..., :2].add(inertia[:2] * jnp.asarray(hidden["line"][:2]) * swing)
    air = body.apply(data.states.vel - jnp.asarray(hidden["wind"]), inverse=True)
    roll, pitch = hidden["velocity_moment"]
    torque = torque.at[..., 0].add(roll * air[..., 1]).at[..., 1].add(-pitch * air[..., 0])
    torque = torque - jnp.asarray(hidden["rate_damping"]) * data.states.ang_vel
    states = data.states.replace(force=force, torque=body.apply(torque))
    return data.replace(states=states)


def fly(request: dict[str, Any]) -> None:
    """Fly all flights of a set side by side and write their log."""
    given = np.load(request["input"])
    goals, gusts = given["goals"], given["gusts"].copy()
    gusts[:, :, 3:] += given["trim"][:, None]
    sim = build(request, given["thrusts"])
    nominal = Sim(drone=request["drone"], dynamics="first_principles", freq=HERTZ, device="cpu").data.params
    masses = float(nominal.mass[0]), np.diag(np.asarray(nominal.J))
    step = sim.build_step_fn()
    states = sim.data.states.replace(
        pos=jnp.asarray(goals[:, 0, None, :3]), rotor_vel=sim.data.plugins["asked"]
    )
    data = sim.data.replace(states=states)

    def one(data: Any, now: Any) -> Any:
        goal, gust, t = now
        data = functional.state_control(pushed(data, request["hidden"], masses, gust, t), goal)
        seen = data.states
        after = step(data, n_steps=1)
        # What acts on the vehicle in this state; the command of the same instant is known after the step.
        push = first_principles_dynamics(data).acc + jnp.array([0.0, 0.0, G])
        felt = Rotation.from_quat(seen.quat).apply(push, inverse=True)
        return after, jnp.concatenate(
            [seen.pos, seen.quat, seen.ang_vel, felt, after.plugins["asked"]], axis=-1
        )

    @partial(jax.jit)
    def all_of_it(data: Any, goals: Any, gusts: Any, times: Any) -> Any:
        return jax.lax.scan(one, data, (goals, gusts, times))[1]

    count = goals.shape[1]
    log = all_of_it(
        data, _wanted(goals), jnp.asarray(gusts.swapaxes(0, 1)[:, :, None]), np.arange(count) / HERTZ
    )
    np.savez(request["output"], log=np.asarray(log)[:, :, 0].swapaxes(0, 1))


def _wanted(goals: np.ndarray) -> Any:
    """Setpoints (steps, flights, 1, 16) as crazyflow takes them."""
    wanted = np.zeros((goals.shape[1], goals.shape[0], 1, 16))
    wanted[..., :9] = goals[..., :9].swapaxes(0, 1)[:, :, None]
    half = 0.5 * goals[..., 9].swapaxes(0, 1)[:, :, None]
    wanted[..., 11], wanted[..., 12] = np.sin(half), np.cos(half)
    return jnp.asarray(wanted)


def main() -> None:
    """Say what there is to fly, then fly what is asked for."""
    packages = {name: version(name) for name in ("crazyflow", "jax", "mujoco")}
    ready = {"versions": packages, "drones": {name: published(name) for name in DRONES}}
    print(json.dumps({"ready": ready}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        fly(request)
        print(json.dumps({"flown": request["output"]}), flush=True)


if __name__ == "__main__":
    main()
