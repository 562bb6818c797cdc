"""Bundle, cues, trigger and action in C, held to the reference."""

import ctypes
import itertools
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.cues import optical_flow_cues
from onboard.firmware.library import CoreLibrary, Float32Array
from onboard.policy.action import action_moments
from onboard.policy.bundle import (
    HEADER_BYTES,
    MAX_BUNDLE_BYTES,
    PolicyBundleError,
    decode_bundle,
    encode_bundle,
)
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.policy.model import MAX_SUPPORT_VECTORS, ActionLayer, Policy
from onboard.policy.trigger import trigger_values
from tests.drawn_examples import examples
from tests.firmware.float32 import address, floats

ACTIVE = 1
SHIPPED = load_policy(shipped_policy_path("default"))
SAMPLE, LONG = 20_000, 1_000_000
EDGES = (0.0, -0.0, 1e-30, 0.2, 1.0, 30.0, -30.0, 3e38, np.inf, -np.inf, np.nan)


def large_policy(seed: int) -> Policy:
    """As many support vectors as there may be, and the deepest network that still fits."""
    rng = np.random.default_rng(seed)
    widths = (3, 6, 6, 6, 6, 6, 5, 1)
    layers = tuple(
        ActionLayer(
            rng.normal(0.0, 0.5, (after, before)).astype(np.float32),
            rng.normal(0.0, 0.1, after).astype(np.float32),
        )
        for before, after in itertools.pairwise(widths)
    )
    last = ActionLayer(layers[-1].weights * np.float32(1e-3), layers[-1].bias * np.float32(1e-3))
    return Policy(
        name="large",
        scaler_mean=np.array([0.25, 3.0, 0.5], np.float32),
        scaler_std=np.array([0.05, 2.0, 0.2], np.float32),
        support_vectors=rng.normal(size=(MAX_SUPPORT_VECTORS, 3)).astype(np.float32),
        dual_coefficients=rng.uniform(0.0, 0.2, MAX_SUPPORT_VECTORS).astype(np.float32),
        gamma=np.float32(1.5),
        intercept=np.float32(-1.0),
        tau_min=np.float32(0.1),
        tau_max=np.float32(0.5),
        layers=(*layers[:-1], last),
        a_rot_min=np.float32(-9e-3),
        a_rot_max=np.float32(0.0),
    )


POLICIES = {"shipped": SHIPPED, "large": large_policy(0)}


def in_c(core: CoreLibrary, bundle: bytes, states: Float32Array) -> tuple[int, Float32Array, Float32Array]:
    """Status, trigger values and moments; each array is untouched where the bundle is refused."""
    values, moments = np.full((2, len(states)), -7.0, np.float32)
    bank = ctypes.create_string_buffer(bundle, MAX_BUNDLE_BYTES + 16)
    status = core.perch_host_policy(
        bank, len(bundle), len(states), address(states), address(values), address(moments)
    )
    return status, values, moments


def cues_near(policy: Policy, count: int, seed: int) -> Float32Array:
    """States around the policy's region, where its value changes most."""
    rng = np.random.default_rng(seed)
    spread = rng.normal(0.0, 1.5, (count, 3)) * policy.scaler_std + policy.scaler_mean
    return floats(spread, 3)


def check_policy(core: CoreLibrary, policy: Policy, states: Float32Array) -> None:
    status, values, moments = in_c(core, encode_bundle(policy), states)
    assert status == ACTIVE
    compiled = policy.compiled()
    wanted, wanted_moments = trigger_values(compiled, states), action_moments(compiled, states)
    assert np.array_equal(np.isnan(values), np.isnan(wanted))
    finite = ~np.isnan(wanted)
    assert np.abs(values - wanted)[finite].max() <= 1e-6
    assert np.abs(moments - wanted_moments).max() <= 1e-8
    decided = finite & (np.abs(wanted) >= 1e-6)
    assert np.array_equal((values >= 0.0)[decided], (wanted >= 0.0)[decided])


@pytest.mark.parametrize("name", POLICIES)
def test_policy_of_random_states(core: CoreLibrary, name: str) -> None:
    check_policy(core, POLICIES[name], cues_near(POLICIES[name], SAMPLE, seed=1))


@pytest.mark.soak
def test_policy_of_a_million_states(core: CoreLibrary) -> None:
    check_policy(core, SHIPPED, cues_near(SHIPPED, LONG, seed=2))


def test_the_sample_has_states_on_both_sides() -> None:
    values = trigger_values(SHIPPED.compiled(), cues_near(SHIPPED, SAMPLE, seed=1))
    assert 0.02 < np.mean(values >= 0.0) < 0.98


def test_policy_at_the_edges(core: CoreLibrary) -> None:
    states = floats(((a, b, c) for a in EDGES for b in EDGES for c in EDGES), 3)
    check_policy(core, SHIPPED, states)


def in_python(states: Float32Array) -> Float32Array:
    with np.errstate(all="ignore"):
        return floats((optical_flow_cues(*map(float, state)) for state in states), 3)


def cues_in_c(core: CoreLibrary, states: Float32Array) -> Float32Array:
    cues = np.empty((len(states), 3), np.float32)
    core.perch_host_cues(len(states), address(states), address(cues))
    return cues


def test_cues_are_bit_identical(core: CoreLibrary) -> None:
    rng = np.random.default_rng(3)
    states = floats(rng.uniform(-5.0, 5.0, (SAMPLE // 4, 4)), 4)
    assert np.array_equal(cues_in_c(core, states), in_python(states))


def test_cues_at_the_edges(core: CoreLibrary) -> None:
    """At the ceiling, beyond it, standing still, falling, and what is not a number."""
    some = (0.0, -0.0, 1.0, 2.1, -1.0, np.inf, -np.inf, np.nan)
    states = floats(((z, vx, vz, c) for z in some for vx in some for vz in some for c in (2.1, np.nan)), 4)
    assert np.array_equal(cues_in_c(core, states), in_python(states), equal_nan=True)


def status_in_python(bundle: bytes) -> int:
    try:
        decode_bundle(bundle)
    except PolicyBundleError as error:
        return int(error.fault)
    return ACTIVE


def sealed(data: bytearray) -> bytes:
    """With the checksum put right again."""
    data[12:16] = struct.pack("<L", zlib.crc32(data[16:], zlib.crc32(data[:12])))
    return bytes(data)


def status_in_c(core: CoreLibrary, bundle: bytes) -> int:
    if len(bundle) > MAX_BUNDLE_BYTES:  # the drone's memory has no place for them, only for their number
        nothing = np.empty((0, 3), np.float32)
        at = address(nothing)
        return int(core.perch_host_policy(bytes(MAX_BUNDLE_BYTES), len(bundle), 0, at, at, at))
    return in_c(core, bundle, np.empty((0, 3), np.float32))[0]


DAMAGE = st.lists(
    st.tuples(
        st.one_of(st.integers(0, HEADER_BYTES - 1), st.integers(0, MAX_BUNDLE_BYTES - 1)),
        st.binary(max_size=4),
    ),
    max_size=3,
)
GOOD = encode_bundle(SHIPPED)


def damaged(damage: list[tuple[int, bytes]], length: int | None, seal: bool) -> bytes:
    data = bytearray(GOOD)
    for offset, raw in damage:
        data[offset : offset + len(raw)] = raw
    if length is not None:
        data = data[:length] + bytes(max(0, length - len(data)))
    return sealed(data) if seal and len(data) >= 16 else bytes(data)


@settings(max_examples=examples(300), deadline=None)
@given(DAMAGE, st.none() | st.integers(0, MAX_BUNDLE_BYTES + 8), st.booleans())
def test_a_damaged_bundle_gets_the_same_answer(
    core: CoreLibrary, damage: list[tuple[int, bytes]], length: int | None, seal: bool
) -> None:
    bundle = damaged(damage, length, seal)
    assert status_in_c(core, bundle) == status_in_python(bundle)


ENDS = (np.nan, 0.0, 1e-6, 1e3, 1.001e3, 100.0, 100.01, 10.0, 10.01, 1e4, 1.01e4, 0.05, 0.051, 1e-9, np.inf)
NUMBERS = st.sampled_from([sign * end for end in ENDS for sign in (1.0, -1.0)])


@settings(max_examples=examples(300), deadline=None)
@given(st.integers(HEADER_BYTES // 4 - 16, len(GOOD) // 4 - 1) | st.integers(6, 17), NUMBERS)
def test_a_number_out_of_its_range_gets_the_same_answer(core: CoreLibrary, place: int, number: float) -> None:
    data = bytearray(GOOD)
    data[4 * place : 4 * place + 4] = struct.pack("<f", number)
    bundle = sealed(data)
    assert status_in_c(core, bundle) == status_in_python(bundle)


@pytest.mark.parametrize("vectors", [0, 1, 249, 250, 251, 65535])
def test_the_number_of_vectors_gets_the_same_answer(core: CoreLibrary, vectors: int) -> None:
    data = bytearray(GOOD)
    data[18:20] = struct.pack("<H", vectors)
    bundle = sealed(data)
    assert status_in_c(core, bundle) == status_in_python(bundle)


def test_a_refused_bundle_is_not_evaluated(core: CoreLibrary) -> None:
    status, values, moments = in_c(core, damaged([(30, b"\xff\xff")], None, False), cues_near(SHIPPED, 3, 0))
    assert status != ACTIVE
    assert (values == -7.0).all()
    assert (moments == -7.0).all()
