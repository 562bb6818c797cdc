"""The policy bundle: round trip, refusals, and the page that documents it."""

import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.app_interface import MEMORY_SIZE, PolicyStatus
from onboard.policy.action import action_moment
from onboard.policy.bundle import (
    MAX_BUNDLE_BYTES,
    BundleFault,
    PolicyBundleError,
    bundle_crc32,
    decode_bundle,
    encode_bundle,
)
from onboard.policy.files import ActionLayer
from onboard.policy.trigger import trigger_value
from tests.drawn_examples import examples
from tests.onboard.policies import policies, small_policy

PAGE = Path(__file__).resolve().parents[2] / "docs" / "policy_bundle.md"
ARRAYS = ("scaler_mean", "scaler_std", "support_vectors", "dual_coefficients")
SCALARS = ("gamma", "intercept", "tau_min", "tau_max", "a_rot_min", "a_rot_max")


def with_crc(data: bytes) -> bytes:
    """The bundle with its header's CRC made right again."""
    return data[:12] + struct.pack("<L", zlib.crc32(data[:12] + data[16:])) + data[16:]


def patched(data: bytes, offset: int, value: bytes) -> bytes:
    return with_crc(data[:offset] + value + data[offset + len(value) :])


@given(policies())
def test_round_trip_is_exact(policy):
    data = encode_bundle(policy)
    decoded = decode_bundle(data)
    assert encode_bundle(decoded) == data
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(decoded, name), getattr(policy, name))
    for name in SCALARS:
        assert getattr(decoded, name) == getattr(policy, name)
    assert decoded.layer_sizes == policy.layer_sizes
    for mine, theirs in zip(decoded.layers, policy.layers, strict=True):
        np.testing.assert_array_equal(mine.weights, theirs.weights)
        np.testing.assert_array_equal(mine.bias, theirs.bias)


@given(policy=policies(), data=st.data())
@settings(max_examples=examples(80))
def test_a_flipped_bit_is_refused(policy, data):
    bundle = bytearray(encode_bundle(policy))
    bit = data.draw(st.integers(0, 8 * len(bundle) - 1))
    bundle[bit // 8] ^= 1 << bit % 8
    with pytest.raises(PolicyBundleError):
        decode_bundle(bytes(bundle))


def test_every_single_bit_of_the_example_matters():
    good = encode_bundle(small_policy())
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        with pytest.raises(PolicyBundleError):
            decode_bundle(bytes(bad))


@given(policy=policies(), data=st.data())
def test_a_truncated_or_extended_bundle_is_refused(policy, data):
    bundle = encode_bundle(policy)
    length = data.draw(st.integers(0, len(bundle) - 1))
    with pytest.raises(PolicyBundleError):
        decode_bundle(bundle[:length])
    with pytest.raises(PolicyBundleError):
        decode_bundle(bundle + data.draw(st.binary(min_size=1, max_size=64)))


@given(st.binary(max_size=400))
def test_noise_is_refused(noise):
    with pytest.raises(PolicyBundleError):
        decode_bundle(noise)


@given(policy=policies(), data=st.data())
@settings(max_examples=examples(80))
def test_changed_bytes_with_a_right_crc_give_a_valid_policy_or_a_refusal(policy, data):
    bundle = bytearray(encode_bundle(policy))
    for _ in range(data.draw(st.integers(1, 4))):
        bundle[data.draw(st.integers(0, len(bundle) - 1))] = data.draw(st.integers(0, 255))
    forged = with_crc(bytes(bundle))
    try:
        decoded = decode_bundle(forged)
    except PolicyBundleError:
        return
    assert encode_bundle(decoded) == forged


NAN, INFINITE = struct.pack("<f", float("nan")), struct.pack("<f", float("inf"))


def f32(value: float) -> bytes:
    return struct.pack("<f", value)


@pytest.mark.parametrize(
    ("offset", "value", "fault"),
    [
        (0, b"XXXX", BundleFault.FORMAT),
        (4, b"\x02\x00", BundleFault.FORMAT),
        (6, b"\x5c\x00", BundleFault.FORMAT),
        (8, b"\xa8", BundleFault.LENGTH),
        (16, b"\x04", BundleFault.FORMAT),
        (18, b"\x00", BundleFault.FORMAT),
        (18, b"\x03", BundleFault.FORMAT),
        (18, b"\xfb\x00", BundleFault.VECTORS),
        (18, b"\xff\xff", BundleFault.VECTORS),
        (20, b"\x00", BundleFault.FORMAT),
        (20, b"\x09", BundleFault.FORMAT),
        (20, b"\x01", BundleFault.FORMAT),
        (22, b"\x00", BundleFault.FORMAT),
        (23, b"\x01", BundleFault.FORMAT),
        (24, f32(0.0), BundleFault.RANGE),
        (24, f32(1001.0), BundleFault.RANGE),
        (24, NAN, BundleFault.RANGE),
        (28, f32(0.0), BundleFault.RANGE),
        (28, f32(1.0), BundleFault.RANGE),
        (32, f32(-0.1), BundleFault.RANGE),
        (32, f32(0.2578125), BundleFault.RANGE),
        (36, INFINITE, BundleFault.RANGE),
        (40, f32(-9.5), BundleFault.RANGE),
        (44, f32(0.001), BundleFault.RANGE),
        (44, f32(-0.0095), BundleFault.RANGE),
        (48, NAN, BundleFault.RANGE),
        (52, f32(1001.0), BundleFault.RANGE),
        (60, f32(0.0), BundleFault.RANGE),
        (64, f32(-2.0), BundleFault.RANGE),
        (72, b"\x00", BundleFault.FORMAT),
        (74, b"\x02", BundleFault.FORMAT),
        (76, b"\x01", BundleFault.FORMAT),
        (88, f32(-0.5), BundleFault.RANGE),
        (96, INFINITE, BundleFault.RANGE),
        (100, f32(100.5), BundleFault.RANGE),
        (120, NAN, BundleFault.RANGE),
        (160, f32(10001.0), BundleFault.RANGE),
    ],
)
def test_each_rule_refuses_with_its_own_fault(offset, value, fault):
    with pytest.raises(PolicyBundleError) as refusal:
        decode_bundle(patched(encode_bundle(small_policy()), offset, value))
    assert refusal.value.fault is fault
    assert fault.name in str(refusal.value)


def test_faults_of_length_and_crc():
    good = encode_bundle(small_policy())
    for bad, fault in (
        (b"", BundleFault.LENGTH),
        (good[:87], BundleFault.LENGTH),
        (good + b"\x00", BundleFault.LENGTH),
        (good[:-1] + b"\x00", BundleFault.CRC),
        (good[:12] + b"\x00\x00\x00\x00" + good[16:], BundleFault.CRC),
        (good + bytes(MAX_BUNDLE_BYTES), BundleFault.LENGTH),
    ):
        with pytest.raises(PolicyBundleError) as refusal:
            decode_bundle(bad)
        assert refusal.value.fault is fault


def test_faults_and_size_are_those_of_the_drones_interface():
    assert {f"REFUSED_{fault.name}": int(fault) for fault in BundleFault} == {
        status.name: int(status)
        for status in PolicyStatus
        if status >= PolicyStatus.REFUSED_LENGTH and status is not PolicyStatus.REFUSED_FLYING
    }
    assert MAX_BUNDLE_BYTES == MEMORY_SIZE


def test_a_policy_too_large_for_the_drone_is_refused():
    wide = tuple(
        ActionLayer(np.zeros((after, before), np.float32), np.zeros(after, np.float32))
        for before, after in ((3, 32), (32, 32), (32, 32), (32, 1))
    )
    with pytest.raises(PolicyBundleError, match="5120") as refusal:
        encode_bundle(replace(small_policy(), layers=wide))
    assert refusal.value.fault is BundleFault.LENGTH


def example_bytes() -> bytes:
    block = re.search(r"```hex\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    return bytes.fromhex("".join(line.split(maxsplit=1)[1] for line in block[1].splitlines()))


def test_the_page_shows_the_bytes_of_its_example():
    data = example_bytes()
    assert data == encode_bundle(small_policy())
    assert f"`0x{bundle_crc32(data):08x}`" in PAGE.read_text(encoding="utf-8")


def test_the_page_shows_what_its_example_computes():
    compiled = decode_bundle(example_bytes()).compiled()
    rows = re.findall(
        r"^\| ([-\d.]+) \| ([-\d.]+) \| ([-\d.]+) \| ([-\d.]+) \| ([-\d.]+) \|$", PAGE.read_text(), re.M
    )
    assert len(rows) == 5
    for *cues, value, moment in [tuple(map(float, row)) for row in rows]:
        assert trigger_value(compiled, *cues) == pytest.approx(value, abs=1e-6)
        assert action_moment(compiled, *cues) == pytest.approx(moment, abs=1e-9)


def test_the_page_is_enough_to_read_a_bundle():
    """The layout table of the page, taken literally, gives the example's numbers."""
    data = example_bytes()
    rows = re.findall(
        r"^\| (\d+) \| (\d+) \| (u8|u16|u32|f32)(?:\[(\d)\])? \| `(\w+)` \|", PAGE.read_text(), re.M
    )
    letters = {"u8": "B", "u16": "H", "u32": "L", "f32": "f"}
    fields = {}
    end = 4
    for offset, size, kind, count, name in rows:
        layout = "<" + (count or "1") + letters[kind]
        assert int(offset) == end
        assert struct.calcsize(layout) == int(size)
        fields[name] = struct.unpack_from(layout, data, int(offset))
        end += int(size)
    assert end == 88 == fields["header_bytes"][0]
    assert fields["length"] == (len(data),)
    assert (fields["vectors"], fields["layers"]) == ((2,), (2,))
    assert fields["mean"] == (0.25, 4.0, 0.5)
    assert fields["std"] == (0.015625, 2.0, 0.25)
    assert fields["sizes"] == (2, 1, 0, 0, 0, 0, 0, 0)
    assert fields["crc32"] == (zlib.crc32(data[:12] + data[16:]),)
