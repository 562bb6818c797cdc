"""Gyroscope and motors through the link to a simulated drone; the motors are off after every way out."""

import threading
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest

from calibration.bench.instruments.drone_log import DroneLog
from calibration.bench.instruments.errors import (
    InstrumentInputError,
    InstrumentLost,
    MotorsNotStopped,
    MotorsRefused,
)
from calibration.bench.instruments.gyro_recorder import GyroRecorder, join
from calibration.bench.instruments.motor_stand import RENEW_WITHIN_S, UNLOCK_PHRASE, MotorStand
from calibration.bench.instruments.set_points import pwm
from onboard.clock import monotonic
from onboard.link import DroneLink, LinkLost
from onboard.link import reboot as reboot_within
from tests.instruments.stand import STILL, Power, Witness, motors, renew_for_ever, unlocked
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.patience import PATIENCE_S, patient_link, until
from tests.tiers import some

BUSY_S = 4.0
"""Silence of a link whose motors are vouched for within a time that a busy machine keeps too."""
SHORT_S = 1.2
"""Silence of a link whose motors want to be vouched for before a packet that was lost is sent again."""


def reboot(uri: str) -> None:
    """Reboot, however busy the machine is."""
    reboot_within(uri, timeout_s=PATIENCE_S)


@pytest.fixture(scope="module")
def drone_uri(crazyflie_uri: str) -> str:
    """The session's drone, as after its boot."""
    reboot(crazyflie_uri)
    return crazyflie_uri


@pytest.fixture
def drone(drone_uri: str) -> Iterator[DroneLink]:
    with patient_link(drone_uri) as link:
        yield link


def missing(times: np.ndarray) -> int:
    """Samples of a 10 ms block that did not come, from whole milliseconds."""
    steps = np.diff(np.round(1e3 * times).astype(int))
    return sum(max(0, round(int(step) / 10) - 1) for step in steps)


def test_gyro_and_accelerometer_come_in_si_units_on_the_drones_clock(drone: DroneLink) -> None:
    with GyroRecorder(drone) as recorder:
        batches = []
        while sum(batch.times.size for batch in batches) < 60:
            batches.append(recorder.take())
        batch = join(batches)
    assert np.linalg.norm(batch.accelerations, axis=1).mean() == pytest.approx(9.81, abs=0.3)
    assert np.abs(batch.rates).max() < 0.2
    assert 3.0 < batch.voltages.mean() < 4.3
    # A drone in real time that waited for a busy machine logs some samples closer together.
    periods = batch.times.size - 1 + batch.lost
    assert (batch.times[-1] - batch.times[0]) / periods == pytest.approx(0.010, rel=0.3)
    assert batch.lost == missing(batch.times)


def test_lost_samples_are_counted(drone_uri: str) -> None:
    port = int(drone_uri.rpartition(":")[2])
    stamps: list[float] = []
    lost = 0
    with (
        FaultyNetwork(port, np.random.default_rng(4), Faults()) as network,
        patient_link(network.uri, silence_s=1.0) as link,
        DroneLog(link, ["pm.vbat"]) as log,
    ):
        network.faults = Faults(loss=0.2)
        while len(stamps) < 120:
            batch = log.take()
            stamps += batch.times.tolist()
            lost += batch.lost
        network.faults = Faults()
    assert lost > 5
    assert lost == missing(np.array(stamps))


def test_an_override_that_somebody_left_on_is_switched_off(drone: DroneLink) -> None:
    drone.set_params({"motorPowerSet.m1": 5120, "motorPowerSet.enable": 1})
    with MotorStand(drone) as stand:
        assert stand.stopped is not None
        assert stand.stopped.confirmed
        assert drone.param("motorPowerSet.enable") == 0


def test_armed_motors_refuse_a_recording_and_the_stand(drone: DroneLink) -> None:
    until(lambda: drone.supervisor_info().can_arm)  # it may have booted a moment ago
    drone.arm()
    try:
        until(lambda: drone.supervisor_info().is_armed)  # the bits are up to 40 ms old
        with pytest.raises(MotorsRefused, match="is armed: disarm"):
            GyroRecorder(drone)
        with MotorStand(drone, no_remote_cut=True) as stand:
            with pytest.raises(MotorsRefused, match="is armed"):
                stand.unlock(UNLOCK_PHRASE)
            with pytest.raises(MotorsRefused, match="locked"):
                stand.spin({1: pwm(40)})
    finally:
        drone.disarm()


@pytest.mark.parametrize("phrase", ["", "yes", "props guarded", "props guarded drone clamped"])
def test_motors_never_turn_without_the_whole_phrase(drone: DroneLink, phrase: str) -> None:
    with MotorStand(drone, no_remote_cut=True) as stand:
        with pytest.raises(MotorsRefused, match="type 'props guarded, drone clamped'"):
            stand.unlock(phrase)
        for turn in (lambda: stand.spin({1: pwm(40)}), lambda: stand.spin_all(pwm(40))):
            with pytest.raises(MotorsRefused, match="locked"):
                turn()
        assert drone.param("motorPowerSet.enable") == 0


def test_a_stand_elsewhere_asks_for_what_is_so_there(drone: DroneLink) -> None:
    hung = "propellers off, drone hung"
    with MotorStand(drone, no_remote_cut=True, unlock_phrase=hung) as stand:
        with pytest.raises(MotorsRefused, match=f"type '{hung}'"):
            stand.unlock(UNLOCK_PHRASE)
        with pytest.raises(MotorsRefused, match=f"unlock them with '{hung}'"):
            stand.spin({1: pwm(40)})
        stand.unlock(hung)
        stand.spin({1: pwm(40)})


def test_motors_never_turn_when_nobody_could_cut_them_off(drone: DroneLink) -> None:
    with MotorStand(drone) as stand:
        with pytest.raises(MotorsRefused, match="nothing would stop them if this program died"):
            stand.unlock(UNLOCK_PHRASE)
        with pytest.raises(MotorsRefused, match="locked"):
            stand.spin({1: pwm(40)})
    power = Power()
    power.gone.set()
    with pytest.raises(InstrumentLost, match="keeper is gone"):
        unlocked(drone, remote_cut=power)
    assert drone.param("motorPowerSet.enable") == 0


def test_the_heart_beats_until_the_motors_are_off(drone: DroneLink) -> None:
    power = Power()
    with unlocked(drone, remote_cut=power) as stand:
        stand.spin({2: pwm(60)})
        motors(stand, (0, pwm(60), 0, 0))
        until(lambda: stand.take(0.05) and len(power.beats) >= 5)
        assert not power.resting
    assert power.resting
    assert power.cuts == []


def test_motors_stop_when_nobody_could_cut_them_off_any_more(drone: DroneLink) -> None:
    power, witness = Power(), Witness(drone)
    try:
        with unlocked(drone, remote_cut=power) as stand:
            stand.spin({3: pwm(60)})
            motors(stand, (0, 0, pwm(60), 0), witness)
            power.gone.set()
            witness.await_ratios(STILL)
            with pytest.raises(InstrumentLost, match="keeper is gone"):
                renew_for_ever(stand)
    finally:
        witness.close()


def test_motors_turn_as_told_one_alone_and_all(drone: DroneLink) -> None:
    with unlocked(drone) as stand:
        stand.spin({2: pwm(60)})
        motors(stand, (0, pwm(60), 0, 0))
        stand.spin({1: pwm(30), 4: pwm(255)})
        motors(stand, (pwm(30), 0, 0, pwm(255)))
        stand.spin_all(pwm(50))
        motors(stand, (pwm(50),) * 4)
        batch = stand.take()
        assert 2.5 < batch.values["pm.vbat"].mean() < 4.3
        report = stand.stop()
        assert report.confirmed
        assert report.seconds < 4.0  # half a second; the rest is for a machine that is eight times slower
    assert stand.stopped is not None
    assert drone.param("motorPowerSet.enable") == 0


@pytest.mark.parametrize("bad", [{5: 256}, {0: 256}, {1: 100}, {1: 65536}, {1: -256}])
def test_set_points_that_the_pwm_cannot_keep_are_refused(drone: DroneLink, bad: dict[int, int]) -> None:
    with unlocked(drone) as stand, pytest.raises(InstrumentInputError):
        stand.spin(bad)
    with pytest.raises(InstrumentInputError):
        pwm(256)
    assert drone.param("motorPowerSet.m1") == 0


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_motors_are_off_after_any_exception(drone: DroneLink, error: type[BaseException]) -> None:
    witness = Witness(drone)
    try:
        with pytest.raises(error), unlocked(drone) as stand:  # noqa: PT012
            stand.spin({1: pwm(60)})
            motors(stand, (pwm(60), 0, 0, 0), witness)
            raise error
        witness.await_ratios(STILL)
    finally:
        witness.close()


def test_motors_stop_when_nobody_renews(drone_uri: str) -> None:
    # Patience is waited for here.
    with patient_link(drone_uri, silence_s=10.0) as drone, unlocked(drone) as stand:
        stand.spin({1: pwm(60)})
        start = monotonic()
        until(lambda: stand.stopped is not None)
        assert stand.stopped is not None
        assert stand.stopped.confirmed
        assert monotonic() - start - stand.stopped.seconds >= RENEW_WITHIN_S - 0.05
        assert drone.param("motorPowerSet.enable") == 0
        with pytest.raises(MotorsRefused, match="nobody renewed"):
            stand.renew()
        with pytest.raises(MotorsRefused, match="nobody renewed"):
            stand.spin({1: pwm(60)})
        stand.unlock(UNLOCK_PHRASE)
        stand.spin({1: pwm(30)})
        motors(stand, (pwm(30), 0, 0, 0))


def test_motors_stop_when_an_instrument_is_lost(drone: DroneLink) -> None:
    gone = threading.Event()

    def check() -> None:
        if gone.is_set():
            raise InstrumentLost("the tachometer is gone: unplugged?")

    witness = Witness(drone)
    try:
        with unlocked(drone, instruments=[check]) as stand:
            stand.spin({3: pwm(60)})
            motors(stand, (0, 0, pwm(60), 0), witness)
            gone.set()
            witness.await_ratios(STILL)
            with pytest.raises(InstrumentLost, match="tachometer is gone"):
                renew_for_ever(stand)
    finally:
        witness.close()


@pytest.mark.parametrize("with_supply", some([True, False], 2))
def test_a_lost_link_cuts_the_power_and_is_not_called_a_stop(drone_uri: str, with_supply: bool) -> None:
    port = int(drone_uri.rpartition(":")[2])
    power = Power()
    settings = {"remote_cut": power}
    with FaultyNetwork(port, np.random.default_rng(4), Faults()) as network:
        link = patient_link(network.uri, silence_s=BUSY_S)
        stand = unlocked(link, **(settings if with_supply else {}))
        stand.spin({1: pwm(60)})
        motors(stand, (pwm(60), 0, 0, 0))
        network.frozen.set()
        with pytest.raises((LinkLost, InstrumentLost)):
            renew_for_ever(stand)
        until(lambda: link.lost)
        lost = monotonic()
        with pytest.raises(MotorsNotStopped, match=r"MAY STILL TURN.*link is lost"):
            stand.close()
        link.close()
    assert bool(power.cuts) is with_supply
    assert not power.cuts or min(power.cuts) < lost, "the power goes before the link is given up"
    assert not power.resting
    reboot(drone_uri)  # nothing else stops them now


def test_a_stop_is_confirmed_over_a_bad_network(drone_uri: str) -> None:
    port = int(drone_uri.rpartition(":")[2])
    with (
        FaultyNetwork(port, np.random.default_rng(4), Faults()) as network,
        patient_link(network.uri, silence_s=BUSY_S) as link,
        unlocked(link) as stand,
    ):
        network.faults = Faults(loss=0.1, duplicate=0.05)
        with suppress(MotorsRefused):  # nobody renewed them in time, for this network and a busy machine
            for step in (30, 60, 90):
                stand.spin({1: pwm(step)})
                stand.renew()
        assert stand.stop().confirmed
        network.faults = Faults()


def test_a_set_point_that_takes_longer_than_a_renewal_may_is_no_hang(drone_uri: str) -> None:
    """A copy of the first set-point never arrives: the next one is confirmed when it cannot any more."""
    first = pwm(30).to_bytes(2, "little")
    withheld: list[bytes] = []

    def lose_one(packet: bytes) -> bool:
        if packet[0] & 0xF3 != 0x22 or packet[3:] != first or withheld:
            return False
        withheld.append(packet)
        return True

    with (
        FaultyNetwork(int(drone_uri.rpartition(":")[2]), np.random.default_rng(4), Faults()) as network,
        patient_link(network.uri, silence_s=SHORT_S) as link,
        unlocked(link) as stand,
    ):
        network.withheld = lose_one
        stand.spin({1: pwm(30)})
        start = monotonic()
        stand.spin({1: pwm(60)})
        assert monotonic() - start > RENEW_WITHIN_S * link.patience
        assert withheld
        assert stand.stopped is None
        motors(stand, (pwm(60), 0, 0, 0))


def test_a_drone_that_comes_back_into_reach_is_stopped_through_its_radio_chip(drone_uri: str) -> None:
    port = int(drone_uri.rpartition(":")[2])
    with FaultyNetwork(port, np.random.default_rng(4), Faults()) as network:
        link = patient_link(network.uri, silence_s=BUSY_S)
        stand = unlocked(link)
        stand.spin({1: pwm(60)})
        network.frozen.set()
        with pytest.raises((LinkLost, InstrumentLost)):
            renew_for_ever(stand)
        while link.lost is None:
            threading.Event().wait(0.01)
        network.frozen.clear()
        stand.close()
        link.close()
        assert stand.stopped is not None
        assert stand.stopped.confirmed
    with patient_link(drone_uri) as second:
        assert second.param("motorPowerSet.enable") == 0
