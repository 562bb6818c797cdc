"""The app's shell: the firmware's hooks, tables, memory and start-up checks, on a firmware made for tests."""

import shutil
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.bench.instruments.motor_token import EVERY_S
from onboard.app_interface import (
    LOGS,
    MOTOR_STOP_MS,
    MOTOR_TOKEN_MS,
    PARAMETERS,
    EngineCode,
    LandingState,
    Log,
    Parameter,
    PolicyStatus,
    TrajectoryStatus,
)
from onboard.firmware.compiler import SOURCES
from onboard.firmware.constants import vehicle_crc32
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.trajectory import plan_from_velocity, sample_approach
from onboard.vehicle import load_vehicle
from tests.drawn_examples import examples
from tests.firmware.shell import Shell, Variable

VEHICLE = "crazyflie21-upgraded"
POSITION_MODES = {"mode_x": 1, "mode_y": 1, "mode_z": 1, "mode_yaw": 1}
ITS_OWN = {Parameter.VEHICLE_CRC: vehicle_crc32(load_vehicle(VEHICLE)), Parameter.ENGINE: EngineCode.C}
RECORD_ADDRESS = 0x10000
ENDED = (LandingState.BRAKE, LandingState.HOLD)
CONTROL_MODE_LEGACY, CONTROL_MODE_FORCE = 0, 2


def boot(library: Path) -> Shell:
    """A drone of its own: a library that is loaded twice has its variables once."""
    with tempfile.TemporaryDirectory() as folder:
        return Shell(Path(shutil.copy(library, folder)))


@pytest.fixture
def shell(shell_library: Path) -> Shell:
    return boot(shell_library)


@pytest.fixture(scope="module")
def shell_on_the_ground(shell_library: Path) -> Shell:
    """One for tests that only touch its memory."""
    return boot(shell_library)


def hover(shell: Shell, x: float = 0.0, z: float = 1.0) -> None:
    """In the air, poses coming, the planner holding."""
    shell.world.flying = shell.world.armed = True
    shell.state.position.x, shell.state.position.z = x, z
    shell.setpoint.position.x, shell.setpoint.position.z = x, z
    for mode, value in POSITION_MODES.items():
        setattr(shell.setpoint, mode, value)
    fly(shell, 40)


def fly(shell: Shell, milliseconds: int) -> None:
    """Steps with a pose every 10 ms."""
    for _ in range(milliseconds):
        if shell.world.tick_ms % 10 == 0:
            shell.world.pose_tick = shell.world.tick_ms % 65536
        shell.step()


def commit(shell: Shell, data: bytes) -> int:
    shell.upload(data)
    shell.set(Parameter.POLICY_LENGTH, len(data))
    shell.set(Parameter.POLICY_CRC, zlib.crc32(data))
    shell.set(Parameter.POLICY_COMMIT, 1)
    return int(shell.read(Parameter.POLICY_STATUS))


def bundle() -> bytes:
    return encode_bundle(load_policy(shipped_policy_path("default")))


def test_the_tables_are_those_of_the_interface(shell: Shell) -> None:
    ours = [v for v in shell.parameters() if v.name.startswith("perch")]
    assert ours == [Variable(str(entry.name), entry.type, entry.read_only) for entry in PARAMETERS]
    assert {v for v in shell.logs() if v.name.startswith("perch")} == {
        Variable(str(entry.name), entry.type) for entry in LOGS
    }
    for entry in PARAMETERS:
        assert shell.read(entry.name) == ITS_OWN.get(entry.name, entry.default)


def test_names_fit_the_firmware(shell: Shell) -> None:
    """Group, name and two zeros share the 26 bytes of a packet of the table of contents."""
    assert all(len(v.name) - 1 + 2 <= 26 for v in [*shell.parameters(), *shell.logs()])


def test_a_policy_goes_live_and_reads_back(shell: Shell) -> None:
    data = bundle()
    assert commit(shell, data) == PolicyStatus.ACTIVE
    assert shell.read(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(data)
    assert shell.read(Parameter.POLICY_COMMIT) == 0
    back = b"".join(shell.read_memory(a, min(24, len(data) - a)) or b"" for a in range(0, len(data), 24))
    assert back == data


def test_a_damaged_policy_leaves_the_live_one(shell: Shell) -> None:
    data = bundle()
    commit(shell, data)
    damaged = bytes([data[0] ^ 1]) + data[1:]
    assert commit(shell, damaged) == PolicyStatus.REFUSED_FORMAT
    assert shell.read(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(data)


def test_nothing_is_committed_or_written_in_the_air(shell: Shell) -> None:
    data = bundle()
    hover(shell)
    assert not shell.write_memory(0, data[:25])
    shell.set(Parameter.POLICY_COMMIT, 1)
    assert shell.read(Parameter.POLICY_STATUS) == PolicyStatus.REFUSED_FLYING


@settings(max_examples=examples(300), deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 255))
def test_whatever_a_packet_says_no_byte_outside_is_touched(
    shell_on_the_ground: Shell, address: int, length: int
) -> None:
    """The firmware hands lengths over as they came: its buffers hold 24 bytes to read and 25 to write."""
    shell = shell_on_the_ground
    inside = any(
        start <= address and address + length <= end
        for start, end in ((0, 5120), (RECORD_ADDRESS, shell.memory_size))
    )
    assert (shell.read_memory(address, length) is not None) == (inside and length <= 24)
    accepted = address + length <= 5120 and length <= 25
    assert shell.write_memory(address, bytes(length)) == accepted


def test_the_planner_is_flown_by_the_firmwares_pid_or_by_our_law(shell: Shell) -> None:
    hover(shell)
    before = shell.asked.pid_steps
    fly(shell, 10)
    assert shell.asked.pid_steps == before + 10
    assert shell.control.mode == CONTROL_MODE_LEGACY
    shell.set(Parameter.OWN_LAW, 1)
    fly(shell, 10)
    assert shell.control.mode == CONTROL_MODE_FORCE
    weight = load_vehicle(VEHICLE).body.mass.value * 9.81
    # At rest where it shall be: each motor's share of the voltage gives about a quarter of the weight.
    assert all(0.3 < duty < 0.9 for duty in shell.control.forces), weight
    shell.setpoint = type(shell.setpoint)()
    fly(shell, 10)
    assert list(shell.control.forces) == [0.0] * 4


@pytest.mark.parametrize(("field", "wrong"), [("idle_thrust", 7000), ("estimator", 1), ("motor_override", 1)])
def test_a_firmware_of_another_configuration_is_disarmed_on_the_ground(
    shell: Shell, field: str, wrong: int
) -> None:
    shell.step(40)
    setattr(shell.world, field, wrong)
    shell.world.armed = True
    shell.step(20)
    assert not shell.world.armed
    for mode, value in POSITION_MODES.items():
        setattr(shell.setpoint, mode, value)
    pid_steps = shell.asked.pid_steps
    for own_law in (0, 1):
        shell.set(Parameter.OWN_LAW, own_law)
        shell.step(10)
        assert list(shell.control.forces) == [0.0] * 4
    assert shell.asked.pid_steps == pid_steps, "the firmware's PID gives no thrust either"
    shell.world.motor_override = 0
    setattr(shell.world, field, {"estimator": 2}.get(field, 0))
    shell.world.armed = True
    shell.step(40)
    assert shell.world.armed


def test_bench_motors_of_a_host_that_does_not_vouch_are_left_alone(shell: Shell) -> None:
    """Other people's tools: as with the stock firmware."""
    shell.world.motor_override = 1
    shell.step(1000)
    assert shell.world.motor_override == 1


def test_bench_motors_stop_when_their_host_falls_silent(shell: Shell) -> None:
    shell.set(Parameter.MOTOR_TOKEN, 1)
    shell.world.motor_override = 1
    for _ in range(10):
        shell.step(100)
        shell.set(Parameter.MOTOR_TOKEN, 1)
    assert shell.world.motor_override == 1
    shell.step(MOTOR_TOKEN_MS + 1)
    assert shell.world.motor_override == 0


@pytest.mark.parametrize("late_ms", [0, MOTOR_STOP_MS - MOTOR_TOKEN_MS - 1])
def test_however_its_last_word_falls_they_stop_within_a_quarter_of_a_second(
    shell: Shell, late_ms: int
) -> None:
    """The app's task looks every 20 ms, and waits `late_ms` for others; the motors follow in the next ms."""
    shell.world.app_late_ms = late_ms
    times = []
    for phase in range(20 + late_ms):
        shell.step(100 + phase)
        shell.set(Parameter.MOTOR_TOKEN, 1)
        shell.world.motor_override = 1
        silent_since = shell.world.tick_ms
        while shell.world.motor_override:
            shell.step()
        times.append(shell.world.tick_ms - silent_since)
    assert MOTOR_TOKEN_MS <= min(times) <= max(times) < MOTOR_STOP_MS
    assert max(times) >= MOTOR_TOKEN_MS + late_ms


def test_bench_motors_of_a_host_that_lives_turn_on(shell: Shell) -> None:
    """It speaks every 50 ms: three words that are lost, and 19 ms of delay, are not silence."""
    shell.set(Parameter.MOTOR_TOKEN, 1)
    shell.world.motor_override = 1
    for _ in range(20):
        shell.step(4 * round(1e3 * EVERY_S) + 19)
        assert shell.world.motor_override == 1
        shell.set(Parameter.MOTOR_TOKEN, 1)


def test_the_answer_to_an_arming_comes_from_the_control_loop(shell: Shell) -> None:
    hover(shell)
    assert shell.write(Parameter.TRAJECTORY_ARM, 1)
    assert shell.read(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.NONE
    assert not shell.write(Parameter.POLICY_ARM, 1)  # packets for the parameter task wait
    while shell.read(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.NONE:
        fly(shell, 1)
    assert shell.read(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.REFUSED_NUMBERS
    assert shell.read(Parameter.TRAJECTORY_ARM) == 0


def test_a_request_that_nobody_takes_holds_the_parameters_for_20_ms(shell: Shell) -> None:
    """The control loop hangs: the parameter task must not, for the reception of packets waits behind it."""
    assert shell.write(Parameter.TRAJECTORY_ARM, 1)
    waited = 0
    while shell._library.shim_parameter_task_waits():
        shell._library.shim_go_on_with_parameters()
        waited += 1
    assert waited == 20


def arm(shell: Shell) -> None:
    """The shipped policy, and an approach of 2.5 m/s at 60 deg from where the drone hovers."""
    vx, vz = 1.25, 2.165
    shell_plan = plan_from_velocity(vx, vz, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5)
    assert commit(shell, bundle()) == PolicyStatus.ACTIVE
    hover(shell, shell_plan.x0, shell_plan.z0)
    for name, value in (
        (Parameter.CEILING_Z, 2.1), (Parameter.SPEED_X, vx), (Parameter.SPEED_Z, vz),
        (Parameter.ACCELERATION_X, 1.0), (Parameter.ACCELERATION_Z, 3.1), (Parameter.TAU_START, 0.5),
    ):  # fmt: skip
        shell.set(name, value)
    shell.set(Parameter.TRAJECTORY_ARM, 1)
    assert shell.read(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
    shell.set(Parameter.POLICY_ARM, 1)
    shell.set(Parameter.GO, 1)
    fly(shell, 2)
    assert shell.read(Parameter.GO) == 0
    assert shell.log(Log.STATE) == LandingState.APPROACH


def follow_the_approach(shell: Shell, until: Callable[[], bool]) -> None:
    """The drone is where the approach wants it, until something holds."""
    plan = plan_from_velocity(1.25, 2.165, 0.0, 0.0, 2.1, 1.0, 3.1, 0.5)
    for ms in range(4000):
        if until():
            return
        position, velocity, _ = sample_approach(plan, 1e-3 * ms)
        shell.state.position.x, shell.state.position.z = position[0], position[2]
        shell.state.velocity.x, shell.state.velocity.z = velocity[0], velocity[2]
        fly(shell, 1)
    raise AssertionError("it did not happen within 4 s")


def test_an_approach_ends_in_a_flip_and_cut_motors(shell: Shell) -> None:
    arm(shell)
    stops = shell.asked.planner_stops
    follow_the_approach(shell, lambda: shell.log(Log.STATE) == LandingState.FLIP)
    assert shell.control.mode == CONTROL_MODE_FORCE
    assert min(shell.control.forces) == 0.0 < max(shell.control.forces)
    assert shell.log(Log.SNAPSHOT_COUNT) == 1
    assert abs(shell.log(Log.SNAPSHOT_TICK) - shell.world.tick_ms) <= 12
    assert 0.15 < shell.log(Log.SNAPSHOT_TAU) < 0.35
    shell.sensors.gyro.y = -1200.0  # deg/s, nose up
    for _ in range(300):
        if shell.log(Log.STATE) == LandingState.CUT:
            break
        fly(shell, 1)
    fly(shell, 2)
    assert list(shell.control.forces) == [0.0] * 4
    assert shell.asked.planner_stops == stops + 1
    recorded = shell.read_memory(RECORD_ADDRESS, 16)
    assert recorded is not None
    assert int.from_bytes(recorded[:4], "little") > 30


def test_an_abort_brakes_holds_and_hands_the_drone_back_to_the_planner(shell: Shell) -> None:
    arm(shell)
    follow_the_approach(shell, lambda: shell.state.velocity.z > 1.0)
    shell.set(Parameter.ABORT, 1)
    fly(shell, 4)
    assert shell.read(Parameter.ABORT) == 0
    assert shell.log(Log.STATE) in ENDED
    shell.state.velocity = type(shell.state.velocity)()
    shell.set(Parameter.TRAJECTORY_ARM, 0)
    shell.set(Parameter.POLICY_ARM, 0)
    for _ in range(5000):
        if shell.log(Log.STATE) == LandingState.IDLE:
            break
        fly(shell, 1)
    assert shell.log(Log.STATE) == LandingState.IDLE
    assert (shell.asked.planner_goals, shell.asked.priorities_relaxed) == (1, 1)
    assert shell.asked.goal[2] == pytest.approx(shell.state.position.z, abs=0.3)


def test_level_out_ends_an_approach(shell: Shell) -> None:
    """The supervisor's own setpoint: no position, level, no turning."""
    arm(shell)
    follow_the_approach(shell, lambda: shell.state.velocity.z > 0.5)
    shell.setpoint = type(shell.setpoint)(mode_z=1, mode_roll=1, mode_pitch=1, mode_yaw=2)
    fly(shell, 4)
    assert shell.log(Log.STATE) in ENDED


@pytest.mark.parametrize("start", [1000, 65_400, 2**32 - 300])
def test_poses_that_stop_are_noticed_however_the_clocks_wrap(shell: Shell, start: int) -> None:
    shell.world.tick_ms = start
    arm(shell)
    follow_the_approach(shell, lambda: shell.state.velocity.z > 0.5)
    before = shell.log(Log.STATE)
    shell.step(400)
    assert before == LandingState.APPROACH
    assert shell.log(Log.STATE) in ENDED


def test_the_build_lists_every_source() -> None:
    for folder, build in ((SOURCES / "app" / "src", "Kbuild"), (SOURCES / "core", "Kbuild")):
        listed = {
            line.split("+=")[1].strip()
            for line in (folder / build).read_text().splitlines()
            if line.startswith("obj-y")
        }
        assert listed == {f"{file.stem}.o" for file in folder.glob("*.c")}
