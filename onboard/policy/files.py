"""Policy files: load, save, import from the authors' format, and the policies that ship with the code.

A policy file is JSON with ``schema = "perchhw.policy/1"``. It holds the CRC32 of its bundle, so that a
damaged or hand-edited file is recognised before it comes near a drone.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from onboard.checked_arguments import checked_name
from onboard.policy.bundle import decode_bundle, is_bundle, policy_crc32
from onboard.policy.json_table import JsonTable, PolicyFileError
from onboard.policy.model import (
    INPUT_NAMES,
    PAPER_A_ROT_LIMIT,
    ActionLayer,
    CompiledPolicy,
    Float32Array,
    Policy,
    PolicyError,
)
from onboard.policy.trigger_region import tau_range
from onboard.schema import schema_problem

__all__ = [
    "ActionLayer",
    "CompiledPolicy",
    "Policy",
    "PolicyError",
    "PolicyFileError",
    "find_policy",
    "import_authors_policy",
    "load_policy",
    "make_policy",
    "policy_crc32",
    "policy_document",
    "save_policy",
    "shipped_policies",
    "shipped_policy_path",
]

SCHEMA = "perchhw.policy/1"
SUFFIX = ".policy.json"
_SHIPPED_FOLDER = Path(__file__).parent / "library"
_NEWTON_MILLIMETRE = 1.0e-3  # N m


def make_policy(
    *,
    name: str,
    scaler_mean: ArrayLike,
    scaler_std: ArrayLike,
    support_vectors: ArrayLike,
    dual_coefficients: ArrayLike,
    gamma: float,
    intercept: float,
    layers: tuple[ActionLayer, ...],
    a_rot_limits: tuple[float, float] = (-PAPER_A_ROT_LIMIT, 0.0),
    provenance: Mapping[str, Any],
) -> Policy:
    """A new policy; the range of tau that its trigger region covers is computed here.

    Args:
        name: a word or two for lists and reports.
        scaler_mean: (3,) of tau, theta_x, d_ceil.
        scaler_std: (3,).
        support_vectors: (n, 3), standardised.
        dual_coefficients: (n,).
        gamma: of the radial basis function.
        intercept: < 0, added to the sum.
        layers: action network with its output in N m.
        a_rot_limits: smallest (most nose-up) and largest moment that the policy may command, N m.
        provenance: how it came about (JSON values).

    Raises:
        PolicyError: the numbers cannot be a policy.
    """
    # Every check but that of tau's range comes first, with a stand-in for it; then the range is computed from
    # the float32 numbers, because those decide on the drone.
    checked = Policy(
        name=name,
        scaler_mean=np.asarray(scaler_mean),
        scaler_std=np.asarray(scaler_std),
        support_vectors=np.asarray(support_vectors),
        dual_coefficients=np.asarray(dual_coefficients),
        gamma=np.float32(gamma),
        intercept=np.float32(intercept),
        tau_min=np.float32(0.0),
        tau_max=np.float32(1.0),
        layers=layers,
        a_rot_min=np.float32(a_rot_limits[0]),
        a_rot_max=np.float32(a_rot_limits[1]),
        provenance=provenance,
    )
    tau_min, tau_max = tau_range(
        scaler_mean=checked.scaler_mean,
        scaler_std=checked.scaler_std,
        support_vectors=checked.support_vectors,
        dual_coefficients=checked.dual_coefficients,
        gamma=float(checked.gamma),
        intercept=float(checked.intercept),
    )
    return replace(checked, tau_min=np.float32(tau_min), tau_max=np.float32(tau_max))


def load_policy(path: str | Path) -> Policy:
    """Read a policy file, or a bundle as ``perchhw policy export`` writes it.

    Raises:
        PolicyFileError: naming file and key.
        PolicyBundleError: the bundle is damaged.
    """
    path = Path(path)
    if is_bundle(path):
        return decode_bundle(path.read_bytes(), name=path.stem, provenance={"bundle": path.name})
    document = JsonTable.from_file(path)
    schema = document.value("schema") if "schema" in document else None
    problem = schema_problem(schema, SCHEMA)
    if problem is not None:
        hint = (
            "; import it first: perchhw policy import FILE --out NAME.policy.json"
            if schema is None and "trigger" in document and "scaler" in document
            else "; perchhw learn and perchhw policy import write such files"
        )
        raise document.error("schema", f"{problem}{hint}")
    return _policy_from(document)


def _policy_from(document: JsonTable) -> Policy:
    document.only("schema", "name", "inputs", "scaler", "trigger", "action", "provenance", "bundle_crc32")
    if document.value("inputs") != list(INPUT_NAMES):
        raise document.error("inputs", f"must be {list(INPUT_NAMES)}")
    scaler, trigger, action = (document.table(key) for key in ("scaler", "trigger", "action"))
    scaler.only("mean", "std")
    trigger.only("kernel", "gamma", "intercept", "tau_min", "tau_max", "dual_coefficients", "support_vectors")
    action.only("activation", "unit", "a_rot_min", "a_rot_max", "layers")
    _expect(trigger, "kernel", "rbf")
    _expect(action, "activation", "elu")
    _expect(action, "unit", "N m")
    layers = action.tables("layers")
    for layer in layers:
        layer.only("weights", "bias")
    with _naming(document):
        policy = Policy(
            name=document.text("name"),
            scaler_mean=scaler.vector("mean"),
            scaler_std=scaler.vector("std"),
            support_vectors=trigger.matrix("support_vectors"),
            dual_coefficients=trigger.vector("dual_coefficients"),
            gamma=trigger.number("gamma"),
            intercept=trigger.number("intercept"),
            tau_min=trigger.number("tau_min"),
            tau_max=trigger.number("tau_max"),
            layers=tuple(ActionLayer(layer.matrix("weights"), layer.vector("bias")) for layer in layers),
            a_rot_min=action.number("a_rot_min"),
            a_rot_max=action.number("a_rot_max"),
            provenance=document.table("provenance").content(),
        )
        crc = policy_crc32(policy)
    expected = document.integer("bundle_crc32")
    if crc != expected:
        raise document.error(
            "bundle_crc32",
            f"is 0x{expected:08x}, but the numbers in the file give 0x{crc:08x}: the file was damaged or "
            "edited; take an undamaged copy, or train or import the policy again",
        )
    return policy


@contextmanager
def _naming(document: JsonTable) -> Iterator[None]:
    """Put the file's name before a complaint about its numbers."""
    try:
        yield
    except PolicyFileError:
        raise
    except PolicyError as error:
        raise document.error("", f"{error}; train or import the policy again") from error


def policy_document(policy: Policy) -> dict[str, Any]:
    """The content of a policy file."""
    return {
        "schema": SCHEMA,
        "name": policy.name,
        "inputs": list(INPUT_NAMES),
        "scaler": {"mean": _plain(policy.scaler_mean), "std": _plain(policy.scaler_std)},
        "trigger": {
            "kernel": "rbf",
            "gamma": _plain(policy.gamma),
            "intercept": _plain(policy.intercept),
            "tau_min": _plain(policy.tau_min),
            "tau_max": _plain(policy.tau_max),
            "dual_coefficients": _plain(policy.dual_coefficients),
            "support_vectors": _plain(policy.support_vectors),
        },
        "action": {
            "activation": "elu",
            "unit": "N m",
            "a_rot_min": _plain(policy.a_rot_min),
            "a_rot_max": _plain(policy.a_rot_max),
            "layers": [
                {"weights": _plain(layer.weights), "bias": _plain(layer.bias)} for layer in policy.layers
            ],
        },
        "provenance": dict(policy.provenance),
        "bundle_crc32": policy_crc32(policy),
    }


def _plain(values: Float32Array | np.float32) -> Any:
    """JSON numbers, each the shortest decimal that gives the same float32 again."""
    if np.ndim(values) == 0:
        return float(str(np.float32(values)))
    return [_plain(item) for item in values]  # type: ignore[union-attr]  # an array of one dimension or more


def save_policy(policy: Policy, path: str | Path) -> None:
    """Write a policy file.

    Raises:
        PolicyBundleError: the policy is too large for a bundle.
        PolicyFileError: the file cannot be written.
    """
    path = Path(path)
    text = json.dumps(policy_document(policy), indent=1, allow_nan=False) + "\n"
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise PolicyFileError(f"{path}: cannot be written ({error.strerror}); check the folder") from error


def import_authors_policy(path: str | Path, name: str | None = None) -> Policy:
    """Read a policy in the form in which the paper's authors' own policy is kept (``flown_policy.json``).

    Two conventions change on the way in (paper errata 5 and 7). Their second input is OF_y = -theta_x: the
    second mean, the second coordinate of every support vector and the second column of the first layer change
    sign, so that both stages give exactly what they gave. Their network's output is in N mm: the last layer
    is divided by 1000.

    Raises:
        PolicyFileError: naming file and key.
    """
    path = Path(path)
    document = JsonTable.from_file(path)
    inputs = document.value("inputs")
    if not (isinstance(inputs, list) and len(inputs) == len(INPUT_NAMES) and "of_y" in str(inputs[1])):
        raise document.error("inputs", f"is {inputs!r:.60}; an authors' policy has tau, of_y, d_ceil")
    scaler, trigger, action = (document.table(key) for key in ("scaler", "trigger", "action"))
    _expect(trigger, "kernel", "rbf")
    _expect(action, "activation", "elu")
    mean, std = scaler.vector("mean"), scaler.vector("std")
    if "scaler" in action:
        own = action.table("scaler")
        if not (np.array_equal(own.vector("mean"), mean) and np.array_equal(own.vector("std"), std)):
            raise document.error("action.scaler", "differs from scaler; both stages must share one")
    negate = np.array([1.0, -1.0, 1.0], np.float32)
    weights = [layer.matrix("W") for layer in action.tables("layers")]
    biases = [layer.vector("b") for layer in action.tables("layers")]
    vectors = trigger.matrix("support_vectors")
    if not weights:
        raise document.error("action.layers", "is empty")
    for key, array in (
        ("scaler.mean", mean),
        ("trigger.support_vectors", vectors),
        ("action.layers[0].W", weights[0]),
    ):
        if array.shape[-1] != len(negate):
            raise document.error(key, f"has {array.shape[-1]} columns; the policy has three inputs")
    weights[0] = weights[0] * negate
    weights[-1] = weights[-1] * np.float32(_NEWTON_MILLIMETRE)
    biases[-1] = biases[-1] * np.float32(_NEWTON_MILLIMETRE)
    source = document.text("source") if "source" in document else ""
    with _naming(document):
        return make_policy(
            name=name or path.name.removesuffix(".json"),
            scaler_mean=mean * negate,
            scaler_std=std,
            support_vectors=vectors * negate,
            dual_coefficients=trigger.vector("dual_coef"),
            gamma=float(trigger.number("gamma")),
            intercept=float(trigger.number("intercept")),
            layers=tuple(ActionLayer(w, b) for w, b in zip(weights, biases, strict=True)),
            provenance={
                "method": "imported from the authors' format: OF_y negated to theta_x, N mm to N m",
                "file": path.name,
                "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
                "source": source,
            },
        )


def _expect(table: JsonTable, key: str, value: str) -> None:
    if table.text(key) != value:
        raise table.error(key, f"is {table.text(key)!r}; only {value!r} is supported")


def shipped_policies() -> tuple[str, ...]:
    """Names of the policies that come with the code."""
    return tuple(sorted(path.name.removesuffix(SUFFIX) for path in _SHIPPED_FOLDER.glob(f"*{SUFFIX}")))


def shipped_policy_path(name: str = "default") -> Path:
    """The file of a policy that comes with the code.

    Raises:
        PolicyFileError: there is no such policy.
    """
    path = _SHIPPED_FOLDER / f"{name}{SUFFIX}"
    if not path.is_file():
        known = ", ".join(shipped_policies()) or "none"
        raise PolicyFileError(f"no policy {name!r} comes with perchhw; there are: {known}")
    return path


def find_policy(name_or_path: str | Path) -> Path:
    """What an operator means by a policy: an existing file, or the name of a shipped one.

    Raises:
        PolicyFileError: it is neither.
        ArgumentError: it is no name at all.
    """
    name = checked_name(name_or_path, "policy")
    path = Path(name)
    if path.exists():
        return path
    if name in shipped_policies():
        return shipped_policy_path(name)
    known = ", ".join(shipped_policies()) or "none"
    raise PolicyFileError(f"{path}: no such file, and no shipped policy of that name; shipped: {known}")
