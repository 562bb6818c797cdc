"""What the drone keeps of a landing: float32 as law and policy had it, read back through its memory."""

import ctypes

import numpy as np
import pytest

from onboard.app_interface import LandingState
from onboard.cues import optical_flow_cues
from onboard.firmware.library import CoreLibrary, vehicle_constants
from onboard.firmware.structures import PERIODS, PerchRecorder
from onboard.mixer import flip_thrusts
from onboard.policy.action import action_moment
from onboard.policy.bundle import MAX_BUNDLE_BYTES, decode_bundle
from onboard.policy.trigger import trigger_value
from onboard.rotation import body_z, euler_angles
from sim_backend.crazyflie.c_engine import CEngine
from sim_backend.crazyflie.engine import Sample, SnapshotField
from tests.firmware.histories import APPROACHES, BUNDLE, LANDING, VEHICLE, Stretch, samples, write

RECORD_ADDRESS = 0x10000
AFTER_MS = 300
LANDED = [
    *LANDING,
    Stretch(300, motion="flip"),
    Stretch(900, "disarm", motion="stay", flying=False),
    Stretch(40, "policy off", flying=False),
]


class Landing:
    """A flight of the engine in C, with its samples and what it did, by tick."""

    def __init__(self, history: list[Stretch]) -> None:
        self.engine = CEngine(VEHICLE)
        self.samples: dict[int, Sample] = {}
        self.states: dict[int, LandingState] = {}
        self.thrusts: dict[int, tuple[float, ...]] = {}
        for stretch, sample in samples(history, seed=5):
            if stretch is not None:
                write(self.engine, stretch)
            self.engine.step(sample)
            self.samples[sample.tick] = sample
            self.states[sample.tick] = self.engine.state
            self.thrusts[sample.tick] = self.engine.thrusts

    def record(self, core: CoreLibrary) -> PerchRecorder:
        """Read as a client does: 24 bytes at a time."""
        size, data = ctypes.sizeof(PerchRecorder), b""
        for place in range(0, size, 24):
            count = min(24, size - place)
            part = ctypes.create_string_buffer(count)
            assert core.perch_memory_read(self.engine._core, RECORD_ADDRESS + place, count, part)
            data += part.raw
        return PerchRecorder.from_buffer_copy(data)


@pytest.fixture(scope="module")
def landing() -> Landing:
    return Landing(LANDED)


def ticks_of(record: PerchRecorder) -> list[int]:
    """When each kept period began, the oldest first."""
    count = min(record.begun, PERIODS)
    return [record.last_tick - 10 * (count - 1 - i) for i in range(count)]


def period(record: PerchRecorder, tick: int) -> ctypes.Structure:
    number = record.begun - 1 - (record.last_tick - tick) // 10
    return record.period[number % PERIODS]


def test_seven_tenths_of_a_second_around_the_trigger(core: CoreLibrary, landing: Landing) -> None:
    record = landing.record(core)
    trigger = landing.engine.snapshot_tick
    assert record.state == 0
    assert (record.periods, record.period_bytes) == (PERIODS, ctypes.sizeof(record.period[0]))
    ticks = ticks_of(record)
    assert len(ticks) * 10 >= 700
    assert ticks[0] <= trigger - 390
    assert ticks[-1] == trigger + AFTER_MS - 10


def test_the_law_had_what_is_recorded(core: CoreLibrary, landing: Landing) -> None:
    record = landing.record(core)
    for tick in ticks_of(record):
        for place, at in enumerate((tick, tick + 4)):
            law, sample = period(record, tick).law[place], landing.samples[at]
            numbers = np.frombuffer(law.estimate, np.float32)
            assert np.array_equal(numbers, [*sample.estimator.state[:10], *sample.gyro], equal_nan=True)
            assert tuple(law.thrusts) == landing.thrusts[at]
            assert law.voltage == pytest.approx(4.0, abs=0.2)


def test_the_reference_on_the_recorded_inputs_triggers_on_the_same_sample(
    core: CoreLibrary, landing: Landing
) -> None:
    """Cues, policy and flip of the reference, on nothing but what was read back."""
    record, policy = landing.record(core), decode_bundle(BUNDLE).compiled()
    ceiling_z, fired = APPROACHES[0].ceiling_z, None
    for tick in ticks_of(record):
        kept = period(record, tick)
        e = kept.law[0].estimate
        cues = optical_flow_cues(e.position.z, e.velocity.x, e.velocity.z, ceiling_z)
        value = float(trigger_value(policy, *map(float, cues)))
        if landing.states[tick] in (LandingState.APPROACH, LandingState.FLIP):
            assert kept.policy.trigger_value == pytest.approx(value, abs=1e-6)
        if fired is None and value >= 0.0:
            fired = tick
            wanted = flip_thrusts(float(action_moment(policy, *map(float, cues))), VEHICLE.body.arm_x.value)
            assert tuple(kept.law[0].thrusts) == pytest.approx(wanted, abs=1e-6)
    assert fired == landing.engine.snapshot_tick


def test_the_own_attitude_is_recorded(core: CoreLibrary, landing: Landing) -> None:
    """The pitch of the trigger's snapshot is that of the machine's own attitude."""
    record, trigger = landing.record(core), landing.engine.snapshot_tick
    own = period(record, trigger).law[0].own_attitude
    pitch = euler_angles((own.x, own.y, own.z, own.w))[1]
    assert pitch == pytest.approx(landing.engine.snapshot(SnapshotField.PITCH), abs=1e-6)
    upside_down = period(record, trigger + 240).law[0].own_attitude
    assert body_z((upside_down.x, upside_down.y, upside_down.z, upside_down.w))[2] < 0.0


def test_arming_begins_another_record(core: CoreLibrary) -> None:
    first = [*LANDING[:3], Stretch(300, "go", motion="plan"), Stretch(900, "disarm", motion="stay")]
    landing = Landing([*first, Stretch(60, "arm"), Stretch(100, "go", motion="plan")])
    record = landing.record(core)
    assert record.state == 1
    assert record.begun == pytest.approx(16, abs=1)


@pytest.mark.parametrize(
    ("address", "count", "fits"),
    [
        (0, 24, True),
        (MAX_BUNDLE_BYTES - 24, 24, True),
        (MAX_BUNDLE_BYTES - 23, 24, False),
        (MAX_BUNDLE_BYTES, 1, False),
        (RECORD_ADDRESS - 1, 2, False),
        (RECORD_ADDRESS, 24, True),
        (RECORD_ADDRESS + ctypes.sizeof(PerchRecorder) - 24, 24, True),
        (RECORD_ADDRESS + ctypes.sizeof(PerchRecorder) - 23, 24, False),
        (0xFFFFFFF0, 24, False),
        (0xFFFFFFFF, 1, False),
    ],
)
def test_reads_within_a_region_alone(core: CoreLibrary, address: int, count: int, fits: bool) -> None:
    memory = ctypes.create_string_buffer(core.core_bytes)
    constants = vehicle_constants(VEHICLE)
    core.perch_boot(memory, constants)
    assert core.perch_memory_read(memory, address, count, ctypes.create_string_buffer(count)) is fits


@pytest.mark.parametrize(
    ("address", "flying", "fits"),
    [
        (0, False, True),
        (0, True, False),
        (MAX_BUNDLE_BYTES - 24, False, True),
        (MAX_BUNDLE_BYTES - 23, False, False),
        (RECORD_ADDRESS, False, False),
        (0xFFFFFFF8, False, False),
    ],
)
def test_writes_to_the_staged_bundle_alone(core: CoreLibrary, address: int, flying: bool, fits: bool) -> None:
    memory = ctypes.create_string_buffer(core.core_bytes)
    constants = vehicle_constants(VEHICLE)
    core.perch_boot(memory, constants)
    before = memory.raw
    assert core.perch_memory_write(memory, address, 24, b"\xa5" * 24, flying) is fits
    assert (memory.raw != before) is fits
    if fits:
        back = ctypes.create_string_buffer(24)
        assert core.perch_memory_read(memory, address, 24, back)
        assert back.raw == b"\xa5" * 24


def test_the_memory_ends_with_the_record(core: CoreLibrary) -> None:
    assert core.perch_memory_size() == RECORD_ADDRESS + ctypes.sizeof(PerchRecorder)
