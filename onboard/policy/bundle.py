"""The policy bundle: the binary that the drone gets. Layout and rules: ``docs/policy_bundle.md``.

Little endian, float32, at most 5120 bytes, guarded by a CRC32 in its header. The C firmware and the simulated
drone read the same bytes.
"""

import struct
import zlib
from collections.abc import Mapping
from enum import IntEnum
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from onboard.policy.model import (
    INPUT_COUNT,
    MAX_LAYER_WIDTH,
    MAX_LAYERS,
    MAX_SUPPORT_VECTORS,
    ActionLayer,
    Float32Array,
    Policy,
    PolicyError,
)

MAGIC = b"PHPB"
VERSION = 1
MAX_BUNDLE_BYTES = 5120
"""The drone has room for two, staged and live. 250 vectors leave 258 numbers for the network."""
ACTIVATION_ELU = 1

# magic, version, header length, bundle length, crc
_PREAMBLE = struct.Struct("<4sHHLL")
# input count, support vector count, layer count, activation, reserved
_COUNTS = struct.Struct("<HHHBB")
# gamma, intercept, tau_min, tau_max, a_rot_min, a_rot_max, scaler mean (3), scaler std (3)
_NUMBERS = struct.Struct("<12f")
_SIZES = struct.Struct(f"<{MAX_LAYERS}H")
_CRC_OFFSET = 12
_COUNTS_OFFSET = _PREAMBLE.size
_NUMBERS_OFFSET = _COUNTS_OFFSET + _COUNTS.size
_SIZES_OFFSET = _NUMBERS_OFFSET + _NUMBERS.size
HEADER_BYTES = _SIZES_OFFSET + _SIZES.size


class BundleFault(IntEnum):
    """Why a bundle is refused, with the numbers that the drone reports in ``perch.polStat``."""

    LENGTH = 16
    CRC = 17
    FORMAT = 18
    RANGE = 19
    VECTORS = 21


class PolicyBundleError(PolicyError):
    """Bytes that are not a usable policy bundle.

    Attributes:
        fault: which of the rules refused it.
    """

    def __init__(self, fault: BundleFault, problem: str) -> None:
        super().__init__(
            f"policy bundle refused ({fault.name}): {problem}; export it again from its policy file"
        )
        self.fault = fault


def bundle_crc32(data: bytes) -> int:
    """CRC32 (zlib) of the complete bundle: the number by which host and drone call a policy."""
    return zlib.crc32(data)


def policy_crc32(policy: Policy) -> int:
    """:func:`bundle_crc32` of the policy's bundle."""
    return bundle_crc32(encode_bundle(policy))


def is_bundle(path: Path) -> bool:
    """Whether a file begins as a policy bundle does; one that cannot be read does not."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def encode_bundle(policy: Policy) -> bytes:
    """The bundle of a policy.

    Raises:
        PolicyBundleError: the policy is too large for a bundle.
    """
    payload = [policy.dual_coefficients, policy.support_vectors]
    for layer in policy.layers:
        payload += [layer.weights, layer.bias]
    body = b"".join(part.astype("<f4").tobytes() for part in payload)
    length = HEADER_BYTES + len(body)
    if length > MAX_BUNDLE_BYTES:
        raise PolicyBundleError(
            BundleFault.LENGTH,
            f"it would have {length} bytes and the drone has room for {MAX_BUNDLE_BYTES}; train with fewer "
            "support vectors (smaller nu) or a smaller network",
        )
    sizes = policy.layer_sizes[1:]
    counts = _COUNTS.pack(INPUT_COUNT, len(policy.dual_coefficients), len(sizes), ACTIVATION_ELU, 0)
    numbers = _NUMBERS.pack(
        policy.gamma,
        policy.intercept,
        policy.tau_min,
        policy.tau_max,
        policy.a_rot_min,
        policy.a_rot_max,
        *policy.scaler_mean,
        *policy.scaler_std,
    )
    layer_sizes = _SIZES.pack(*sizes, *[0] * (MAX_LAYERS - len(sizes)))
    preamble = _PREAMBLE.pack(MAGIC, VERSION, HEADER_BYTES, length, 0)[:_CRC_OFFSET]
    rest = counts + numbers + layer_sizes + body
    return preamble + struct.pack("<L", zlib.crc32(rest, zlib.crc32(preamble))) + rest


def decode_bundle(
    data: bytes, *, name: str = "bundle", provenance: Mapping[str, Any] | None = None
) -> Policy:
    """The policy in a bundle.

    Args:
        data: the complete bundle.
        name: a bundle carries no name; this one is given to the policy.
        provenance: likewise.

    Raises:
        PolicyBundleError: with the rule that refused it, in the order length, format, CRC, dimensions and
        number of vectors, ranges.
    """
    sizes, support_vector_count = _checked_dimensions(data)
    gamma, intercept, tau_min, tau_max, a_rot_min, a_rot_max, *scaler = _NUMBERS.unpack_from(
        data, _NUMBERS_OFFSET
    )
    body = np.frombuffer(data, dtype="<f4", offset=HEADER_BYTES)
    vectors_end = support_vector_count * (1 + INPUT_COUNT)
    try:
        return Policy(
            name=name,
            scaler_mean=np.array(scaler[:INPUT_COUNT], np.float32),
            scaler_std=np.array(scaler[INPUT_COUNT:], np.float32),
            support_vectors=body[support_vector_count:vectors_end].reshape(-1, INPUT_COUNT),
            dual_coefficients=body[:support_vector_count],
            gamma=gamma,
            intercept=intercept,
            tau_min=tau_min,
            tau_max=tau_max,
            layers=_layers(body[vectors_end:], sizes),
            a_rot_min=a_rot_min,
            a_rot_max=a_rot_max,
            provenance=provenance or {},
        )
    except PolicyError as error:
        raise PolicyBundleError(BundleFault.RANGE, str(error)) from error


def _checked_dimensions(data: bytes) -> tuple[tuple[int, ...], int]:
    """Apply every rule but the ranges; gives the layer sizes (the input first) and the vector count."""
    if not HEADER_BYTES <= len(data) <= MAX_BUNDLE_BYTES:
        raise PolicyBundleError(
            BundleFault.LENGTH, f"{len(data)} bytes, expected {HEADER_BYTES} to {MAX_BUNDLE_BYTES}"
        )
    magic, version, header_bytes, length, crc = _PREAMBLE.unpack_from(data)
    if magic != MAGIC:
        raise PolicyBundleError(BundleFault.FORMAT, f"it begins with {magic!r}, expected {MAGIC!r}")
    if version != VERSION or header_bytes != HEADER_BYTES:
        raise PolicyBundleError(
            BundleFault.FORMAT,
            f"layout version {version} with a header of {header_bytes} bytes; this software reads version "
            f"{VERSION} with {HEADER_BYTES}",
        )
    if length != len(data):
        raise PolicyBundleError(BundleFault.LENGTH, f"{len(data)} bytes, but its header says {length}")
    actual = zlib.crc32(data[_COUNTS_OFFSET:], zlib.crc32(data[:_CRC_OFFSET]))
    if actual != crc:
        raise PolicyBundleError(
            BundleFault.CRC, f"its CRC32 is 0x{actual:08x}, but its header says 0x{crc:08x}"
        )

    inputs, vectors, layers, activation, reserved = _COUNTS.unpack_from(data, _COUNTS_OFFSET)
    if inputs != INPUT_COUNT or activation != ACTIVATION_ELU or reserved != 0:
        raise PolicyBundleError(
            BundleFault.FORMAT,
            f"{inputs} inputs, activation {activation}, reserved byte {reserved}; expected 3, 1, 0",
        )
    if vectors > MAX_SUPPORT_VECTORS:
        raise PolicyBundleError(
            BundleFault.VECTORS,
            f"{vectors} support vectors, and the drone's control loop has time for {MAX_SUPPORT_VECTORS}",
        )
    if not (vectors >= 1 and 1 <= layers <= MAX_LAYERS):
        raise PolicyBundleError(
            BundleFault.FORMAT, f"{vectors} support vectors and {layers} layers are not possible"
        )
    table = _SIZES.unpack_from(data, _SIZES_OFFSET)
    sizes = (INPUT_COUNT, *table[:layers])
    widths_good = all(1 <= size <= MAX_LAYER_WIDTH for size in sizes) and sizes[-1] == 1
    if not widths_good or any(table[layers:]):
        raise PolicyBundleError(
            BundleFault.FORMAT, f"layer sizes {table} are not possible with {layers} layers"
        )
    numbers = vectors * (1 + INPUT_COUNT)
    numbers += sum(outputs * (inputs + 1) for inputs, outputs in pairwise(sizes))
    if length != HEADER_BYTES + 4 * numbers:
        raise PolicyBundleError(
            BundleFault.FORMAT, f"{length} bytes, but its dimensions need {HEADER_BYTES + 4 * numbers}"
        )
    return sizes, vectors


def _layers(numbers: Float32Array, sizes: tuple[int, ...]) -> tuple[ActionLayer, ...]:
    layers = []
    start = 0
    for inputs, outputs in pairwise(sizes):
        bias = start + outputs * inputs
        end = bias + outputs
        layers.append(ActionLayer(numbers[start:bias].reshape(outputs, inputs), numbers[bias:end]))
        start = end
    return tuple(layers)
