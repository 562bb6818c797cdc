"""Gyroscope and motors through the link to a simulated drone; the motors are off after every way out."""

import itertools
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

import numpy as np
import pytest

from calibration.bench.instruments import motor_stand, uninterrupted
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
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.patience import PATIENCE_S, patient_link, until


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


class Witness:
    """A second look at the motors, by a log block of its own: what the drone drives."""

    def __init__(self, link: DroneLink) -> None:
        self._changed = threading.Condition()
        self.ratios = (0, 0, 0, 0)
        self.seen: set[tuple[int, ...]] = set()
        self._stream = link.stream([f"motor.m{i}" for i in (1, 2, 3, 4)], 10, self._take)

    def _take(self, sample: object) -> None:
        with self._changed:
            self.ratios = tuple(int(value) for value in sample.values.values())  # type: ignore[attr-defined]
            self.seen.add(self.ratios)
            self._changed.notify_all()

    def await_ratios(self, ratios: tuple[int, int, int, int]) -> None:
        """Wait for these ratios."""
        with self._changed:
            assert self._changed.wait_for(lambda: self.ratios == ratios, PATIENCE_S), self.ratios

    def close(self) -> None:
        self._stream.close()


STILL = (0, 0, 0, 0)


class Power:
    """A remote cut that notes what it is told; `gone` makes it one that nobody holds any more."""

    def __init__(self) -> None:
        self.cuts: list[float] = []
        self.beats: list[float] = []
        self.resting = False
        self.gone = threading.Event()

    def cut(self) -> None:
        self.cuts.append(monotonic())

    def beat(self, within_s: float) -> None:
        if self.gone.is_set():
            raise InstrumentLost("the keeper is gone")
        self.beats.append(monotonic())

    def rest(self) -> None:
        self.resting = True


def unlocked(drone: DroneLink, **settings: object) -> MotorStand:
    stand = MotorStand(drone, **{"no_remote_cut": "remote_cut" not in settings, **settings})  # type: ignore[arg-type]
    stand.unlock(UNLOCK_PHRASE)
    return stand


def motors(stand: MotorStand, ratios: tuple[int, ...], witness: Witness | None = None) -> None:
    """Renew until the stand's own log shows these ratios, and the witness has seen them."""
    deadline, shown = monotonic() + PATIENCE_S, False
    while monotonic() < deadline:
        batch = stand.take(0.05)
        if batch.times.size:
            shown = tuple(batch.values[f"motor.m{i}"][-1] for i in (1, 2, 3, 4)) == ratios
        if shown and (witness is None or ratios in witness.seen):
            return
    raise AssertionError(f"the motors do not show {ratios}")


def missing(times: np.ndarray) -> int:
    """Samples of a 10 ms block that did not come, from whole milliseconds."""
    steps = np.diff(np.round(1e3 * times).astype(int))
    return sum(max(0, round(int(step) / 10) - 1) for step in steps)


def renew_for_ever(stand: MotorStand) -> None:
    while True:
        stand.renew()


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


def test_ctrl_c_again_and_again_leaves_no_motor_turning(drone: DroneLink) -> None:
    """Nothing else would stop them: on a battery, by the stock firmware."""
    hangs, seen, goes_on = threading.Event(), threading.Event(), threading.Event()
    heard: list[int] = []

    def check() -> None:
        if hangs.is_set():
            seen.set()
            goes_on.wait()

    def interrupted(number: int, _frame: object) -> None:
        heard.append(number)
        raise KeyboardInterrupt

    def press(stand: MotorStand) -> None:
        try:
            for count in (1, 2):  # the second while the stand closes
                os.kill(os.getpid(), signal.SIGINT)
                until(lambda count=count: len(heard) == count and stand._closing.is_set())
        finally:
            goes_on.set()

    before = signal.signal(signal.SIGINT, interrupted)
    witness = Witness(drone)
    try:
        with pytest.raises(KeyboardInterrupt), unlocked(drone, instruments=[check]) as stand:  # noqa: PT012
            stand.spin({1: pwm(60)})
            motors(stand, (pwm(60), 0, 0, 0), witness)
            hangs.set()
            until(seen.is_set)
            presser = threading.Thread(target=press, args=(stand,))
            presser.start()
            until(lambda: False)
        presser.join()
        witness.await_ratios(STILL)
        assert stand.stopped is not None
        assert stand.stopped.confirmed
    finally:
        witness.close()
        signal.signal(signal.SIGINT, before)


class Key:
    """A trace function that presses Ctrl-C before the line number `at` of the bench's closing code is run."""

    FILES = (motor_stand.__file__, uninterrupted.__file__)

    def __init__(self, at: int) -> None:
        self._to_go = at
        self.was_pressed = False

    def __call__(self, frame: FrameType, event: str, _arg: object) -> "Key | None":
        if frame.f_code.co_filename not in self.FILES:
            return None
        if event == "line":
            if self._to_go == 0:
                self.was_pressed = True
                raise KeyboardInterrupt
            self._to_go -= 1
        return self


def test_ctrl_c_at_any_line_of_the_end_stops_the_motors_all_the_same(drone: DroneLink) -> None:
    """Also between two lines that look harmless. (Before the first one it is as if nobody renewed: below.)"""
    witness = Witness(drone)
    try:
        for at in itertools.count(1):
            witness.seen.clear()
            stand, key = unlocked(drone), Key(at)
            stand.spin({1: pwm(60)})
            motors(stand, (pwm(60), 0, 0, 0), witness)
            sys.settrace(key)
            try:
                stand.close()
            except (KeyboardInterrupt, MotorsNotStopped):  # the key came before the drone's word
                assert key.was_pressed
            finally:
                sys.settrace(None)
            until(lambda stand=stand: stand.stopped is not None)
            assert stand.stopped is not None
            assert stand.stopped.confirmed, at
            witness.await_ratios(STILL)
            stand.close()
            if not key.was_pressed:
                break
        assert at > 10
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


@pytest.mark.parametrize("with_supply", [True, False])
def test_a_lost_link_cuts_the_power_and_is_not_called_a_stop(drone_uri: str, with_supply: bool) -> None:
    port = int(drone_uri.rpartition(":")[2])
    power = Power()
    settings = {"remote_cut": power}
    with FaultyNetwork(port, np.random.default_rng(4), Faults()) as network:
        link = patient_link(network.uri, silence_s=1.0)
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
        patient_link(network.uri, silence_s=1.0) as link,
        unlocked(link) as stand,
    ):
        network.faults = Faults(loss=0.1, duplicate=0.05)
        for step in (30, 60, 90):
            stand.spin({1: pwm(step)})
            stand.renew()
        assert stand.stop().confirmed
        network.faults = Faults()


def test_a_drone_that_comes_back_into_reach_is_stopped_through_its_radio_chip(drone_uri: str) -> None:
    port = int(drone_uri.rpartition(":")[2])
    with FaultyNetwork(port, np.random.default_rng(4), Faults()) as network:
        link = patient_link(network.uri, silence_s=1.0)
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
