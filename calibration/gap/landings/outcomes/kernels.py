"""Compiled: flips from given states at the trigger to rest, hundreds of them at a time.

Vehicles that differ in legs, pads and hull alone fly alike until something touches: :func:`approach` takes
all of them there once, :func:`land` goes on with each. Of pads that differ in one limit many do the same to a
landing, and hulls that lie within one that never touched do, too: it is flown once for all of these.
"""

import math
from typing import Any

import numpy as np

from calibration.gap.landings.kernels import note
from onboard.mixer import Thrusts
from onboard.rotation import body_z
from sim_backend.physics.feet import pad_limit
from sim_backend.physics.jit import alone, inner
from sim_backend.physics.motors import decay
from sim_backend.physics.rollout import RolloutSettings, end_of, record_end
from sim_backend.physics.step import advance, near_surface

APPROACH = np.dtype([("steps", "i8"), ("cut", "i8"), ("over", "i8")], align=True)
"""Of a flip on its way to the ceiling: steps so far, whether motors were cut, whether it never got there."""


@inner
def flip_targets(flip: Any, cut: bool) -> Thrusts:
    """Thrusts (N) of M1..M4 during the flip; none once the motors are cut."""
    return (0.0, 0.0, 0.0, 0.0) if cut else (flip[0], flip[1], flip[2], flip[3])


@inner
def flip_on(state: Any, p: Any, flip: Any, s: RolloutSettings, count: int, cut: bool, decays: Any) -> bool:
    """Step number `count` of a flip; whether the motors are cut, for good once the body axis is horizontal.

    `decays`: of the motors, of half a step (:func:`sim_backend.physics.motors.decay`).
    """
    if count % s.control_steps == 0:
        cut = cut or body_z(state.quaternion)[2] <= 0.0
    advance(state, p, flip_targets(flip, cut), s.dt, decays[0], decays[1])
    return cut


@alone
def fly_flips(states: Any, p: Any, flips: Any, s: RolloutSettings, out: Any) -> None:
    """Fly each state from its trigger until it rests, falls, or time is up.

    Args:
        states: records of :data:`sim_backend.physics.state.STATE` (n,), time 0; end as the last states.
        p: physics parameters.
        flips: thrusts of the motors (N, (n, 4)) until the body axis falls below the horizon.
        s: ends and steps of a rollout.
        out: records of :data:`sim_backend.physics.rollout.ROLLOUT` (n,), zeroed; receive the results.
    """
    decays = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state, result = states[k], out[k]
        result.triggered = 1
        cut = False
        count = 0
        end = -1
        while end < 0:
            cut = flip_on(state, p, flips[k], s, count, cut, decays)
            count += 1
            end = end_of(state, result, s)
        record_end(result, state, end)


@alone
def approach(states: Any, p: Any, flips: Any, s: RolloutSettings, out: Any, ways: Any) -> None:
    """Fly each state until something of the vehicle may touch within a step, or it is over before that.

    Args:
        states: as for :func:`fly_flips`; end where :func:`land` goes on.
        p: physics parameters of a vehicle that reaches as far as any of those that shall land.
        flips, s, out: as for :func:`fly_flips`.
        ways: records of :data:`APPROACH` (n,), zeroed; receive how far each got.
    """
    decays = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state, result, way = states[k], out[k], ways[k]
        result.triggered = 1
        cut = False
        while not way.over and not near_surface(state, p, s.dt):
            cut = flip_on(state, p, flips[k], s, way.steps, cut, decays)
            way.steps += 1
            way.over = 1 if end_of(state, result, s) >= 0 else 0
        way.cut = 1 if cut else 0


@inner
def feet_held(state: Any) -> int:
    """How many feet adhere."""
    attached = state.foot_attached
    return int(attached[0] + attached[1] + attached[2] + attached[3])


@alone
def land(
    states: Any, ways: Any, vehicles: Any, law: int, flips: Any, s: RolloutSettings, out: Any, feet: Any,
    bodies: Any,
) -> int:  # fmt: skip
    """Land each state, after its :func:`approach`, with vehicles whose pads ask for more and more.

    A landing is over as soon as three feet adhere for good: more of them is the same outcome.

    Args:
        states, ways: of :func:`approach`; unchanged.
        vehicles: physics parameters (m,), alike but for one limit of the pads that rises and that landings do
            not differ in; or one vehicle, whatever its pads.
        law: which limit (:mod:`sim_backend.physics.feet`).
        flips, s: as for :func:`fly_flips`.
        out: record of :data:`sim_backend.physics.rollout.ROLLOUT`, zeroed.
        feet: (n, m), -1 where a landing shall be flown; receive how many feet adhere at the end, three
            standing for three or four.
        bodies: (n, m), receive whether hull or propellers touched the ceiling.

    Returns:
        How many landings it took.
    """
    flown = 0
    scratch = states[:1].copy()
    state = scratch[0]
    out.triggered = 1
    for k in range(states.shape[0]):
        rung = 0
        while rung < vehicles.shape[0]:
            if feet[k, rung] >= 0:
                rung += 1
                continue
            p = vehicles[rung]
            decays = decay(p, 0.5 * s.dt)
            for_good = math.isinf(p.adhesion_strength)
            scratch[0] = states[k]
            count, cut = ways[k].steps, ways[k].cut == 1
            over = ways[k].over == 1
            while not over:
                cut = flip_on(state, p, flips[k], s, count, cut, decays)
                count += 1
                over = end_of(state, out, s) >= 0 or (for_good and feet_held(state) >= 3)
            flown += 1
            held = min(feet_held(state), 3)
            feet[k, rung], bodies[k, rung] = held, state.body_contact
            rung += 1
            while rung < vehicles.shape[0] and pad_limit(vehicles[rung], law) <= state.limits_met[law]:
                feet[k, rung], bodies[k, rung] = held, state.body_contact
                rung += 1
    return flown


@alone
def trace_flips(states: Any, p: Any, flips: Any, s: RolloutSettings, traces: Any) -> None:
    """Fly each state for a given time; keep the motion.

    Args:
        states, p, flips, s: as for :func:`fly_flips`.
        traces: (n, steps + 1, COLUMNS), receive start and end of every step.
    """
    decays = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state = states[k]
        cut = False
        note(state, traces[k, 0])
        for count in range(traces.shape[1] - 1):
            cut = flip_on(state, p, flips[k], s, count, cut, decays)
            note(state, traces[k, count + 1])


@alone
def follow_flips(
    states: Any, p: Any, flips: Any, s: RolloutSettings, traces: Any, cuts: Any, out: Any
) -> None:
    """Fly each state as :func:`fly_flips` does, and keep the motion, also beyond the end.

    Args:
        states, p, flips, s: as for :func:`fly_flips`; states end as the last ones.
        traces: (n, rows, COLUMNS), receive start and end of every step, as far as they go.
        cuts: (n,), receive when the motors were cut (s), NaN: never.
        out: as for :func:`fly_flips`, and the same to the last bit.
    """
    decays = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state, result = states[k], out[k]
        result.triggered = 1
        cuts[k] = math.nan
        cut = False
        count = 0
        end = -1
        note(state, traces[k, 0])
        while end < 0 or count < traces.shape[1] - 1:
            was = cut
            cut = flip_on(state, p, flips[k], s, count, cut, decays)
            if cut and not was:
                cuts[k] = count * s.dt
            count += 1
            if count < traces.shape[1]:
                note(state, traces[k, count])
            if end < 0:
                end = end_of(state, result, s)
                if end >= 0:
                    record_end(result, state, end)
