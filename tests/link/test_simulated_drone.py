"""The link to the simulated drone: the real firmware's tables and the perching app, in a process of its
own."""

import itertools
import struct
import threading
import zlib
from collections.abc import Iterator

import numpy as np
import pytest

from onboard.app_interface import Log, Parameter, PolicyStatus
from onboard.link import CommandRefused, DroneLink, LinkLost, LogSample, PolicyRefused
from onboard.link import reboot as reboot_within
from onboard.policy.bundle import encode_bundle
from onboard.supervisor_info import SupervisorInfo
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.onboard.policies import small_policy
from tests.patience import PATIENCE_S, patient_link, until

POLICY = encode_bundle(small_policy())
MAGIC_END, CRC_AT, MEAN_AT = 4, 12, 16 + 8 + 24


def with_crc(bundle: bytes) -> bytes:
    """The bundle with its own checksum made right again."""
    crc = zlib.crc32(bundle[CRC_AT + 4 :], zlib.crc32(bundle[:CRC_AT]))
    return bundle[:CRC_AT] + struct.pack("<I", crc) + bundle[CRC_AT + 4 :]


REFUSED = {
    "damaged": (POLICY[:-1] + bytes((POLICY[-1] ^ 1,)), PolicyStatus.REFUSED_CRC, "checksum"),
    "cut": (POLICY[:-4], PolicyStatus.REFUSED_LENGTH, "length"),
    "foreign": (with_crc(b"ABCD" + POLICY[MAGIC_END:]), PolicyStatus.REFUSED_FORMAT, "format"),
    "not a number": (
        with_crc(POLICY[:MEAN_AT] + struct.pack("<f", float("nan")) + POLICY[MEAN_AT + 4 :]),
        PolicyStatus.REFUSED_RANGE,
        "not finite",
    ),
}


def reboot(uri: str) -> None:
    """Reboot, however busy the machine is."""
    reboot_within(uri, timeout_s=PATIENCE_S)


@pytest.fixture(scope="module")
def network(crazyflie_uri: str) -> Iterator[FaultyNetwork]:
    """A network to the simulated drone, good until a test spoils it."""
    port = int(crazyflie_uri.rpartition(":")[2])
    with FaultyNetwork(port, np.random.default_rng(11), Faults()) as proxy:
        yield proxy


def test_opens_and_uploads_over_a_bad_network(network: FaultyNetwork) -> None:
    network.faults = Faults(loss=0.05, duplicate=0.05, reorder=0.05)
    try:
        with patient_link(network.uri) as link:
            assert link.upload_policy(POLICY) == zlib.crc32(POLICY)
            for value in itertools.count():
                link.set_param("ring.effect", value % 8)
                assert link.param("ring.effect") == value % 8
                if network.lost and network.doubled:
                    break
    finally:
        network.faults = Faults()


@pytest.mark.parametrize("reason", REFUSED)
def test_wrong_policies_are_refused_in_words_and_the_previous_one_stays(
    drone_link: DroneLink, reason: str
) -> None:
    bundle, status, words = REFUSED[reason]
    assert drone_link.upload_policy(POLICY) == zlib.crc32(POLICY)
    with pytest.raises(PolicyRefused, match=words):
        drone_link.upload_policy(bundle)
    assert drone_link.param(Parameter.POLICY_STATUS) == status
    assert drone_link.active_policy_crc() == zlib.crc32(POLICY)


def test_policy_and_parameters_are_gone_after_a_reboot(crazyflie_uri: str) -> None:
    with patient_link(crazyflie_uri) as link:
        link.upload_policy(POLICY)
        link.set_param("ring.effect", 3)
        reboot(crazyflie_uri)
    with patient_link(crazyflie_uri) as link:
        assert link.active_policy_crc() == 0
        assert link.param("ring.effect") != 3


def test_log_streams_keep_the_drones_pace(drone_link: DroneLink) -> None:
    done = threading.Event()
    samples: list[LogSample] = []

    def collect(sample: LogSample) -> None:
        samples.append(sample)
        if len(samples) >= 100:
            done.set()

    names = [*(f"stateEstimate.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz")), Log.STATE]
    others = [
        drone_link.stream(["gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z"], 10, lambda _sample: None)
        for _ in range(7)
    ]
    with drone_link.stream(names, 10, collect) as stream:
        assert done.wait(PATIENCE_S)
        assert (stream.late, stream.malformed, stream.dropped) == (0, 0, 0)
    steps = np.diff([sample.drone_time_ms for sample in samples])
    # Drone time. The median, because a busy computer may let the simulated drone skip a beat.
    assert np.median(steps) == pytest.approx(10.0, abs=0.5)
    assert min(steps) > 0
    assert list(samples[0].values) == names
    until(lambda: all(other.received > 80 for other in others))
    for other in others:
        other.close()


def test_streamed_and_asked_supervisor_information_agree(drone_link: DroneLink) -> None:
    arrived: list[SupervisorInfo] = []
    event = threading.Event()

    def take(sample: LogSample) -> None:
        arrived.append(SupervisorInfo(int(sample.values["supervisor.info"])))
        event.set()

    with drone_link.stream(["supervisor.info"], 100, take):
        assert event.wait(PATIENCE_S)
    assert arrived[0] == drone_link.supervisor_info()


def test_a_long_block_is_right_though_every_request_arrives_twice(network: FaultyNetwork) -> None:
    """The drone would append the variables of the second packet a second time."""
    names = [f"stateEstimateZ.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz")]
    names += [f"motor.m{motor}" for motor in (1, 2, 3, 4)] + ["pm.state", "acc.z"]
    came = threading.Event()
    network.faults = Faults(duplicate=1.0)
    try:
        with (
            patient_link(network.uri) as link,
            link.stream(names, 10, lambda _sample: came.set(), halves={"motor.m1"}) as stream,
        ):
            assert came.wait(PATIENCE_S)
            assert stream.latest is not None
            assert stream.latest.values.keys() == set(names)
            assert stream.latest.values["acc.z"] == pytest.approx(1.0, abs=0.2)
            assert stream.malformed == 0
    finally:
        network.faults = Faults()


def test_commands_follow_the_drones_supervisor(crazyflie_uri: str) -> None:
    reboot(crazyflie_uri)
    with patient_link(crazyflie_uri) as link:
        with pytest.raises(CommandRefused, match="takeoff"):
            link.takeoff(0.3, 1.0)
        arm_when_it_has_booted(link)
        until(lambda: link.supervisor_info().is_armed)  # its bits are up to 40 ms old
        link.disarm()
        until(lambda: not link.supervisor_info().is_armed)
        link.emergency_stop(PATIENCE_S)
        assert link.supervisor_info().is_locked
        with pytest.raises(CommandRefused, match="locked"):
            link.arm()
    reboot(crazyflie_uri)
    with patient_link(crazyflie_uri) as link:
        assert not link.supervisor_info().is_locked


def test_takes_off_although_an_earlier_link_was_closed(crazyflie_uri: str) -> None:
    """Closing a link leaves a zero setpoint behind, of higher priority than the high-level commander."""
    reboot(crazyflie_uri)
    with patient_link(crazyflie_uri) as link:
        link.stop_motors()
    turning = threading.Event()

    def watch(sample: LogSample) -> None:
        if sample.values["motor.m1"] > 10_000.0:
            turning.set()

    with patient_link(crazyflie_uri) as link, link.stream(["motor.m1"], 10, watch):
        arm_when_it_has_booted(link)
        take_off_as_soon_as_it_may_fly(link)
        assert turning.wait(PATIENCE_S)
        link.emergency_stop(PATIENCE_S)
    reboot(crazyflie_uri)


def arm_when_it_has_booted(link: DroneLink) -> None:
    """The supervisor says 25 times a second what it found, and connecting is faster."""
    until(lambda: link.supervisor_info().can_arm)
    link.arm()


def take_off_as_soon_as_it_may_fly(link: DroneLink) -> None:
    """The planner takes commands from the step after the one in which the supervisor lets the drone fly."""

    def takes_off() -> bool:
        try:
            link.takeoff(0.5, 1.0)
        except CommandRefused:
            return False
        return True

    until(takes_off)


def test_poses_reach_the_drones_estimator(drone_link: DroneLink) -> None:
    samples: list[LogSample] = []
    near = threading.Event()

    def take(sample: LogSample) -> None:
        samples.append(sample)
        if abs(sample.values["locSrv.x"] - 0.25) < 1e-6:
            near.set()

    with drone_link.stream(["locSrv.x"], 10, take):

        def sent_and_near() -> bool:
            drone_link.send_pose((0.25, 0.0, 0.02), (0.0, 0.0, 0.0, 1.0))
            return near.wait(0.01)

        until(sent_and_near)


def test_frozen_drone_is_lost(network: FaultyNetwork) -> None:
    with patient_link(network.uri, silence_s=1.0) as link:
        try:
            network.frozen.set()
            with pytest.raises(LinkLost):
                link.upload_policy(POLICY)
        finally:
            network.frozen.clear()
