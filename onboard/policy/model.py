"""What a landing policy is: numbers, their limits, and the arrays that the onboard arithmetic runs on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from onboard.errors import InputError, OnboardError
from onboard.gravity import GRAM_FORCE

Float32Array = NDArray[np.float32]

INPUT_NAMES = ("tau_s", "theta_x_rad_per_s", "d_ceil_m")
"""The policy's inputs in their order: tau, theta_x (positive forward), d_ceil."""

INPUT_COUNT = len(INPUT_NAMES)
MAX_SUPPORT_VECTORS = 250
"""The drone evaluates the trigger inside one step of its 1 kHz control loop. A vector costs 1.07 us there (a
Cortex-M4F at 168 MHz, 1.4 us with the waits of its flash): 250 take 0.35 ms, a third of the step, and leave
room for estimator and controller; 500 would take 0.7 ms. Policies of the paper's kind have 70 to 130."""
MAX_LAYERS = 8
MAX_LAYER_WIDTH = 32

# Limits of what can be a landing policy. They are far wider than any that was ever trained: their purpose is
# to refuse numbers that come from damage or from a wrong unit (N mm for N m, for example), not to judge a
# policy.
GAMMA_LIMIT = 1.0e3
DUAL_LIMIT = 1.0e3
MEAN_LIMIT = 1.0e3
STD_RANGE = (1.0e-6, 1.0e3)
SUPPORT_VECTOR_LIMIT = 1.0e2
WEIGHT_LIMIT = 1.0e4
TAU_LIMIT = 10.0
A_ROT_LIMIT = 0.05

PAPER_A_ROT_LIMIT = 2 * 15 * GRAM_FORCE * 0.0325
"""N m. Two motors of 15 gf at an arm of 32.5 mm: the largest moment of the paper's vehicle (errata 7)."""


class PolicyError(OnboardError, InputError):
    """A policy that cannot be used: the message says which number or file, and what to do."""


class CompiledPolicy(NamedTuple):
    """A policy as the Numba functions take it. All float32 except the sizes; arrays are C-contiguous."""

    scaler_mean: Float32Array  # (3,)
    scaler_std: Float32Array  # (3,)
    support_vectors: Float32Array  # (n, 3), standardised
    dual_coefficients: Float32Array  # (n,)
    gamma: np.float32
    intercept: np.float32
    tau_min: np.float32  # s
    tau_max: np.float32  # s
    layer_sizes: NDArray[np.int32]  # (layers + 1,), the first is 3, the last is 1
    layer_numbers: Float32Array  # per layer: weights (outputs x inputs, row-major), then biases (outputs)
    a_rot_min: np.float32  # N m
    a_rot_max: np.float32  # N m


def _frozen(values: ArrayLike, name: str) -> Float32Array:
    """A private, read-only float32 copy; a value beyond float32 becomes infinite and is refused later."""
    try:
        with np.errstate(over="ignore"):
            array = np.array(values, dtype=np.float32, order="C")
    except (TypeError, ValueError) as error:
        raise PolicyError(f"policy: {name} is not a rectangular array of numbers ({error})") from error
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class ActionLayer:
    """One layer of the action network: ``y = weights @ x + bias``, ELU after every layer but the last."""

    weights: Float32Array
    """(outputs, inputs)."""
    bias: Float32Array
    """(outputs,)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", _frozen(self.weights, "layer weights"))
        object.__setattr__(self, "bias", _frozen(self.bias, "layer bias"))


@dataclass(frozen=True, eq=False)
class Policy:
    """A two-stage landing policy: when to flip (trigger) and how hard (action).

    Inputs are (tau [s], theta_x [rad/s], d_ceil [m]), standardised by the scaler for both stages.
    Construction checks everything and raises :class:`PolicyError`; an existing ``Policy`` is always usable.
    All numbers are float32, as on the drone.
    """

    name: str
    scaler_mean: Float32Array
    """(3,)."""
    scaler_std: Float32Array
    """(3,)."""
    support_vectors: Float32Array
    """(n, 3), standardised."""
    dual_coefficients: Float32Array
    """(n,), >= 0."""
    gamma: np.float32
    intercept: np.float32
    """Added to the sum; < 0, so that the trigger cannot fire far from the region."""
    tau_min: np.float32
    """s. The trigger value is negative at every smaller tau: a trigger missed until then does not come."""
    tau_max: np.float32
    """s. The trigger value is negative at every larger tau."""
    layers: tuple[ActionLayer, ...]
    a_rot_min: np.float32
    """N m, negative: the strongest nose-up moment."""
    a_rot_max: np.float32
    """N m, <= 0: the weakest moment."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """How it came about: JSON values only."""

    def __post_init__(self) -> None:
        for name in ("scaler_mean", "scaler_std", "support_vectors", "dual_coefficients"):
            object.__setattr__(self, name, _frozen(getattr(self, name), name))
        for name in ("gamma", "intercept", "tau_min", "tau_max", "a_rot_min", "a_rot_max"):
            scalar = _frozen(getattr(self, name), name)
            _require(scalar.shape == (), f"{name} must be one number")
            object.__setattr__(self, name, np.float32(scalar))
        object.__setattr__(self, "layers", tuple(self.layers))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        _check_dimensions(self)
        _check_numbers(self)

    @property
    def layer_sizes(self) -> tuple[int, ...]:
        """Width of the input and of every layer, for example (3, 10, 10, 1)."""
        return (INPUT_COUNT, *(len(layer.bias) for layer in self.layers))

    def compiled(self) -> CompiledPolicy:
        """The arrays for :mod:`onboard.policy.trigger` and :mod:`onboard.policy.action`.

        Copies, writable, always of the same types, so that Numba compiles each function once.
        """
        parts = [part for layer in self.layers for part in (layer.weights.ravel(), layer.bias)]
        return CompiledPolicy(
            scaler_mean=self.scaler_mean.copy(),
            scaler_std=self.scaler_std.copy(),
            support_vectors=self.support_vectors.copy(),
            dual_coefficients=self.dual_coefficients.copy(),
            gamma=self.gamma,
            intercept=self.intercept,
            tau_min=self.tau_min,
            tau_max=self.tau_max,
            layer_sizes=np.array(self.layer_sizes, dtype=np.int32),
            layer_numbers=np.concatenate(parts),
            a_rot_min=self.a_rot_min,
            a_rot_max=self.a_rot_max,
        )


def _require(condition: bool | np.bool_, problem: str) -> None:
    if not condition:
        raise PolicyError(f"policy: {problem}")


def _check_dimensions(policy: Policy) -> None:
    """Shapes only; the numbers come next."""
    count = policy.dual_coefficients.size
    _require(policy.scaler_mean.shape == (INPUT_COUNT,), "the scaler needs three means")
    _require(policy.scaler_std.shape == (INPUT_COUNT,), "the scaler needs three standard deviations")
    _require(policy.dual_coefficients.ndim == 1, "dual coefficients must be one list of numbers")
    _require(
        1 <= count <= MAX_SUPPORT_VECTORS,
        f"{count} support vectors; 1 to {MAX_SUPPORT_VECTORS} are possible, more take the drone's control "
        "loop too long: train on fewer pairs or with a smaller nu",
    )
    _require(
        policy.support_vectors.shape == (count, INPUT_COUNT),
        f"{count} dual coefficients need ({count}, 3) support vectors, not {policy.support_vectors.shape}",
    )
    layer_count = len(policy.layers)
    _require(1 <= layer_count <= MAX_LAYERS, f"{layer_count} action layers; 1 to {MAX_LAYERS} are possible")
    inputs = INPUT_COUNT
    for number, layer in enumerate(policy.layers, start=1):
        shape = layer.weights.shape
        _require(layer.bias.ndim == 1, f"the bias of action layer {number} must be one list of numbers")
        outputs = layer.bias.size
        _require(
            shape == (outputs, inputs),
            f"weights of action layer {number} have shape {shape}, expected ({outputs}, {inputs})",
        )
        _require(
            1 <= outputs <= MAX_LAYER_WIDTH,
            f"action layer {number} is {outputs} wide; 1 to {MAX_LAYER_WIDTH}",
        )
        inputs = outputs
    _require(inputs == 1, f"the last action layer gives {inputs} numbers; one moment is expected")


def _check_within(values: Float32Array | np.float32, low: float, high: float, name: str) -> None:
    # The negated form also catches NaN.
    inside = (values >= np.float32(low)) & (values <= np.float32(high))
    if not np.all(inside):
        worst = np.ravel(values)[~np.ravel(inside)][0]
        raise PolicyError(f"policy: {name} holds {worst:g}, outside [{low:g}, {high:g}]")


def _check_numbers(policy: Policy) -> None:
    """Ranges; ``docs/policy_bundle.md`` lists the same rules."""
    _check_within(policy.scaler_mean, -MEAN_LIMIT, MEAN_LIMIT, "scaler mean")
    _check_within(policy.scaler_std, *STD_RANGE, "scaler standard deviation")
    _check_within(policy.support_vectors, -SUPPORT_VECTOR_LIMIT, SUPPORT_VECTOR_LIMIT, "support vectors")
    _check_within(policy.dual_coefficients, 0.0, DUAL_LIMIT, "dual coefficients")
    _check_within(policy.gamma, 0.0, GAMMA_LIMIT, "gamma")
    _require(policy.gamma > 0, "gamma must be above 0")
    _check_within(policy.intercept, -DUAL_LIMIT, 0.0, "intercept")
    _require(policy.intercept < 0, "the intercept must be below 0, or the trigger fires everywhere")
    _check_within(policy.tau_min, 0.0, TAU_LIMIT, "tau_min [s]")
    _check_within(policy.tau_max, 0.0, TAU_LIMIT, "tau_max [s]")
    _require(policy.tau_min < policy.tau_max, "tau_min must be below tau_max")
    for number, layer in enumerate(policy.layers, start=1):
        _check_within(layer.weights, -WEIGHT_LIMIT, WEIGHT_LIMIT, f"weights of action layer {number}")
        _check_within(layer.bias, -WEIGHT_LIMIT, WEIGHT_LIMIT, f"bias of action layer {number}")
    _check_within(policy.a_rot_min, -A_ROT_LIMIT, 0.0, "a_rot_min [N m]")
    _check_within(policy.a_rot_max, -A_ROT_LIMIT, 0.0, "a_rot_max [N m]")
    _require(policy.a_rot_min < policy.a_rot_max, "a_rot_min must be below a_rot_max")
