"""Error of the integrator: free flight and random landings at several rates. Prints one JSON document.

    python benchmarks/integrator_error.py [--landings 1000] [--seed 0]

Free flight is 0.24 s of a powered turn about all axes against 1/32 ms; `order` is the exponent of the
step. Landings are random (1.5 to 3.5 m/s, 30 to 90 deg, trigger at tau 0.21 to 0.25 s, 5 to 9 N mm), from
the trigger to 0.6 s after it, thrusts cut when the body axis falls below the horizon, looked at with 500
Hz at every rate. They are compared one by one with the same landing at 8 kHz and at 64 kHz: the share
with the same outcome class, and, over those, median and 95 % quantile of the differences in time of
impact, tilt at impact, and place at the end, for all and for those without contact of the hull.
"""

import argparse
import json
import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from onboard.mixer import flip_thrusts
from onboard.rotation import body_z
from perchhw.learning.setup import LearningSetup
from sim_backend.physics.outcome import classify
from sim_backend.physics.reset import approaching
from sim_backend.physics.step import step_thrust

LOOK = 2e-3
"""s between two looks at the attitude (500 Hz)."""

AFTER_TRIGGER = 0.6  # s
RATES_KHZ = (1, 2, 4, 8, 64)
REFERENCES_KHZ = (8, 64)


@njit(cache=True)
def fly(states: Any, p: Any, moments: NDArray[np.float64], dt: float) -> None:
    """Flip and land every state in place; `moments` (N m, negative = nose up)."""
    looks, steps = round(AFTER_TRIGGER / LOOK), round(LOOK / dt)
    for k in range(len(states)):
        state = states[k]
        cut = False
        for _ in range(looks):
            cut = cut or body_z(state.quaternion)[2] <= 0.0
            targets = (0.0, 0.0, 0.0, 0.0) if cut else flip_thrusts(moments[k], p.arm_x)
            for _ in range(steps):
                step_thrust(state, p, targets, dt)


@njit(cache=True)
def fly_free(state: Any, p: Any, dt: float) -> None:
    """0.24 s of powered, turning flight."""
    for _ in range(round(0.24 / dt)):
        step_thrust(state, p, (0.11, 0.02, 0.01, 0.10), dt)


def free_flight(parameters: Any) -> dict[str, Any]:
    """Errors of position, velocity, attitude and rate by step, and the order between steps."""
    sky = parameters.copy()
    sky["ceiling_z"] = 1e6

    def end(dt: float) -> Any:
        state = approaching(sky, np.array([0.0, 0.0, 1000.0]), np.array([2.0, 0.5, 2.0]))
        state["omega"] = [2.0, -6.0, 3.0]
        fly_free(state, sky, dt)
        return state

    reference = end(1e-3 / 32)
    steps = (4e-3, 2e-3, 1e-3, 0.5e-3)
    ends = [end(dt) for dt in steps]
    # Half the angle between two attitudes is the distance of their quaternions.
    errors = {
        "position_m": [float(np.linalg.norm(e["position"] - reference["position"])) for e in ends],
        "velocity_m_s": [float(np.linalg.norm(e["velocity"] - reference["velocity"])) for e in ends],
        "attitude_rad": [2 * float(np.linalg.norm(e["quaternion"] - reference["quaternion"])) for e in ends],
        "rate_rad_s": [float(np.linalg.norm(e["omega"] - reference["omega"])) for e in ends],
    }
    order = {name: np.log2(np.divide(e[:-1], e[1:])).tolist() for name, e in errors.items()}
    return {"step_s": steps, "errors": errors, "order": order}


def random_triggers(parameters: Any, count: int, seed: int) -> tuple[Any, NDArray[np.float64]]:
    """States at the trigger and moments (N m)."""
    rng = np.random.default_rng(seed)
    states, moments = [], -rng.uniform(5e-3, 9e-3, count)
    for _ in range(count):
        speed, angle, tau = rng.uniform(1.5, 3.5), math.radians(rng.uniform(30, 90)), rng.uniform(0.21, 0.25)
        velocity = speed * np.array([math.cos(angle), 0.0, math.sin(angle)])
        place = np.array([0.0, 0.0, float(parameters["ceiling_z"]) - tau * velocity[2]])
        states.append(np.array(approaching(parameters, place, velocity)))
    return np.array(states), moments


def tilt_at_impact(states: Any) -> NDArray[np.float64]:
    """Angle (rad) between body axis and vertical at the first contact."""
    q = states["impact_quaternion"]
    return np.asarray(np.arccos(np.clip(1.0 - 2.0 * (q[:, 0] ** 2 + q[:, 1] ** 2), -1.0, 1.0)))


def spread(values: NDArray[np.float64], scale: float) -> dict[str, float]:
    """Median and 95 % quantile of the size of differences."""
    median, most = np.quantile(np.abs(values) * scale, [0.5, 0.95])
    return {"median": float(median), "q95": float(most)}


def outcomes_of(states: Any) -> list[str]:
    """How each landing ended."""
    return [classify(int(one["foot_attached"].sum()), bool(one["body_contact"])).value for one in states]


def compare(states: Any, reference: Any) -> dict[str, Any]:
    """The differences of landings one by one."""
    same = np.array(outcomes_of(states)) == np.array(outcomes_of(reference))
    a, b = states[same], reference[same]
    met = (a["ceiling_contact"] == 1) & (b["ceiling_contact"] == 1)
    apart = np.linalg.norm(a["position"] - b["position"], axis=1)
    return {
        "same_outcome": float(same.mean()),
        "impact_time_ms": spread((a["impact_time"] - b["impact_time"])[met], 1e3),
        "impact_tilt_deg": spread((tilt_at_impact(a) - tilt_at_impact(b))[met], math.degrees(1.0)),
        "place_mm": spread(apart[met], 1e3),
        "place_without_hull_contact_mm": spread(apart[met & (b["body_contact"] == 0)], 1e3),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--landings", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    parameters, _ = LearningSetup(vehicle="crazyflie21-upgraded-stored").load()
    start, moments = random_triggers(parameters, arguments.landings, arguments.seed)
    ends = {}
    for rate in RATES_KHZ:
        ends[rate] = start.copy()
        fly(ends[rate], parameters, moments, 1e-3 / rate)
    outcomes = outcomes_of(ends[RATES_KHZ[-1]])
    document = {
        "benchmark": "integrator_error",
        "free_flight": free_flight(parameters),
        "landings": {
            "count": arguments.landings,
            "seed": arguments.seed,
            "outcomes": {name: outcomes.count(name) for name in sorted(set(outcomes))},
            **{
                f"against_{reference}_khz": {
                    f"{rate}_khz": compare(ends[rate], ends[reference])
                    for rate in RATES_KHZ
                    if rate < reference
                }
                for reference in REFERENCES_KHZ
            },
        },
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
