"""How long one decision of the landing policy takes: the onboard arithmetic beside scikit-learn and torch.

The peers get the same support vectors and weights, one state at a time, as a control loop would ask them. The
drone has 10 ms for a decision (100 Hz). Prints one JSON document:

    python benchmarks/policy_inference.py [--decisions 5000]
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.policy.action import action_moment
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.policy.model import Policy
from onboard.policy.trigger import trigger_value

States = NDArray[np.float32]
Decide = Callable[[States], tuple[float, float]]


def onboard(policy: Policy) -> Decide:
    """Our compiled float32 functions, the ones that the simulated drone calls."""
    compiled = policy.compiled()

    def decide(state: States) -> tuple[float, float]:
        tau, theta_x, d_ceil = state
        value = trigger_value(compiled, tau, theta_x, d_ceil)
        return float(value), float(action_moment(compiled, tau, theta_x, d_ceil))

    return decide


def libraries(policy: Policy) -> Decide:
    """The same policy as scikit-learn's kernel and a torch network would evaluate it."""
    import torch
    from sklearn.metrics.pairwise import rbf_kernel

    compiled = policy.compiled()
    network = torch.nn.Sequential()
    for index, layer in enumerate(policy.layers):
        weights, biases = np.asarray(layer.weights), np.asarray(layer.bias)
        linear = torch.nn.Linear(weights.shape[1], weights.shape[0])
        linear.weight.data, linear.bias.data = (
            torch.from_numpy(weights.copy()),
            torch.from_numpy(biases.copy()),
        )
        network.append(linear)
        if index + 1 < len(policy.layers):
            network.append(torch.nn.ELU())
    mean, scale = np.asarray(policy.scaler_mean), np.asarray(policy.scaler_std)
    vectors = np.asarray(compiled.support_vectors)
    coefficients = np.asarray(compiled.dual_coefficients)

    @torch.no_grad()
    def decide(state: States) -> tuple[float, float]:
        scaled = ((state - mean) / scale)[None, :].astype(np.float32)
        kernel = rbf_kernel(scaled, vectors, gamma=float(policy.gamma))
        value = float(kernel[0] @ coefficients + policy.intercept)
        return value, float(network(torch.from_numpy(scaled))[0, 0])

    return decide


def measure(decide: Decide, states: States) -> dict[str, float]:
    """Microseconds per decision, one state at a time."""
    decide(states[0])
    times = np.empty(len(states))
    for index, state in enumerate(states):
        start = time.perf_counter()
        decide(state)
        times[index] = time.perf_counter() - start
    return {"p50_us": float(np.median(times) * 1e6), "p99_us": float(np.quantile(times, 0.99) * 1e6)}


def main() -> None:
    """Measure both and print the document."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--decisions", type=int, default=5000)
    arguments = parser.parse_args()
    policy = load_policy(shipped_policy_path())
    rng = np.random.default_rng(0)
    states = (
        np.asarray(policy.scaler_mean)
        + np.asarray(policy.scaler_std) * rng.standard_normal((arguments.decisions, 3))
    ).astype(np.float32)
    ours, theirs = onboard(policy), libraries(policy)
    agreement = max(abs(ours(state)[0] - theirs(state)[0]) for state in states[:500])
    results = {"onboard": measure(ours, states), "scikit_learn_and_torch": measure(theirs, states)}
    document: dict[str, Any] = {
        "benchmark": "policy_inference",
        "machine": {"cpus": os.cpu_count(), "python": platform.python_version()},
        "support_vectors": len(policy.compiled().dual_coefficients),
        "largest_disagreement_of_trigger_value": agreement,
        "results": results,
        "ratio_p50": results["scikit_learn_and_torch"]["p50_us"] / results["onboard"]["p50_us"],
    }
    print(json.dumps(document, indent=2))


if __name__ == "__main__":
    main()
