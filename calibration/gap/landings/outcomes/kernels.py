"""Compiled: flips from given states at the trigger to rest, hundreds of them at a time."""

from typing import Any

from calibration.gap.landings.kernels import note
from onboard.mixer import Thrusts
from onboard.rotation import body_z
from sim_backend.physics.jit import inner, outlined
from sim_backend.physics.motors import decay
from sim_backend.physics.rollout import RolloutSettings, end_of, record_end
from sim_backend.physics.step import advance


@inner
def flip_targets(flip: Any, cut: bool) -> Thrusts:
    """Thrusts (N) of M1..M4 during the flip; none once the motors are cut."""
    return (0.0, 0.0, 0.0, 0.0) if cut else (flip[0], flip[1], flip[2], flip[3])


@outlined
def fly_flips(states: Any, p: Any, flips: Any, s: RolloutSettings, out: Any) -> None:
    """Fly each state from its trigger until it rests, falls, or time is up.

    Args:
        states: records of :data:`sim_backend.physics.state.STATE` (n,), time 0; end as the last states.
        p: physics parameters.
        flips: thrusts of the motors (N, (n, 4)) until the body axis falls below the horizon.
        s: ends and steps of a rollout.
        out: records of :data:`sim_backend.physics.rollout.ROLLOUT` (n,), zeroed; receive the results.
    """
    up, down = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state, result = states[k], out[k]
        result.triggered = 1
        cut = False
        count = 0
        end = -1
        while end < 0:
            if count % s.control_steps == 0:
                cut = cut or body_z(state.quaternion)[2] <= 0.0
            advance(state, p, flip_targets(flips[k], cut), s.dt, up, down)
            count += 1
            end = end_of(state, result, s)
        record_end(result, state, end)


@outlined
def trace_flips(states: Any, p: Any, flips: Any, s: RolloutSettings, traces: Any) -> None:
    """Fly each state for a given time; keep the motion.

    Args:
        states, p, flips, s: as for :func:`fly_flips`.
        traces: (n, steps + 1, COLUMNS), receive start and end of every step.
    """
    up, down = decay(p, 0.5 * s.dt)
    for k in range(states.shape[0]):
        state = states[k]
        cut = False
        note(state, traces[k, 0])
        for count in range(traces.shape[1] - 1):
            if count % s.control_steps == 0:
                cut = cut or body_z(state.quaternion)[2] <= 0.0
            advance(state, p, flip_targets(flips[k], cut), s.dt, up, down)
            note(state, traces[k, count + 1])
