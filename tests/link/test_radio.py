"""The radio driver's bounds, on cflib's own threads above a radio that stalls when told."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import cflib.crtp.radiodriver as cflib_radio
import pytest
from cflib.crtp.crtpstack import CRTPPacket

from onboard.link import DroneLink, LinkLost, stop
from onboard.link.errors import LinkError
from onboard.link.radio import CflibStopPort, GuardedRadioDriver
from onboard.link.stop import StopPath
from onboard.link.stop_drone import stop_drone
from onboard.timebase import WallTime
from tests.link.tiny_drone import TinyDrone
from tests.patience import PATIENCE_S, StandingClock, until

POSE, READ, ARM = CRTPPacket(0x61, b"\x08" * 29), CRTPPacket(0x21, b"\x01\x00"), CRTPPacket(0x91, b"\x01\x01")
SAFELINK = (0xFF, 0x05, 0x01)
STOP = b"\x91\x03"
URI = f"radio://0/80/2M/{os.getpid():010X}"
"""Locks are of the machine: no other test run has this one."""
PROMISED_S = 0.02
"""Longest time that a send takes, as docs/link.md says."""
CFLIB_GIVES_UP = 100
"""Sends without an acknowledgement after which cflib 0.1.34 reports a lost link."""


class _Answer:
    def __init__(self, data: Sequence[int], ack: bool = True) -> None:
        self.ack, self.data, self.powerDet, self.retry = ack, tuple(data), False, 0


class StallingRadio:
    """The dongle: acknowledges every packet, unless it is stalled, faded or pulled; a tiny drone answers."""

    DR_2MPS = 2
    stalled = threading.Event()
    faded = threading.Event()
    pulled = threading.Event()
    heard: ClassVar[list[bytes]] = []
    unheard: ClassVar[int] = 0
    drone: ClassVar[TinyDrone]

    def __init__(self, devid: int = 0) -> None:
        self.version = 0.5
        StallingRadio.heard = []
        StallingRadio.unheard = 0
        self._replies: deque[bytes] = deque()

    def send_packet(self, data: Sequence[int]) -> _Answer | None:
        """One exchange on the air."""
        while StallingRadio.stalled.is_set():
            time.sleep(0.001)
        if StallingRadio.pulled.is_set():  # cflib's dongle keeps the error of USB for itself
            StallingRadio.unheard += 1
            time.sleep(0.001)
            return None
        if StallingRadio.faded.is_set():
            StallingRadio.unheard += 1
            time.sleep(0.001)
            return _Answer((), ack=False)
        packet = bytes(data)
        if tuple(packet) == SAFELINK:
            return _Answer(SAFELINK)
        packet = bytes((packet[0] & 0xF3, *packet[1:]))
        if packet != b"\xf3":
            StallingRadio.heard.append(packet)
            self._replies.extend(StallingRadio.drone.answers(packet[0], packet[1:]))
        return _Answer(self._replies.popleft() if self._replies else ())

    def set_channel(self, _channel: int) -> None:
        """As the dongle."""

    def set_address(self, _address: Sequence[int]) -> None:
        """As the dongle."""

    def set_data_rate(self, _rate: int) -> None:
        """As the dongle."""

    def set_arc(self, _retries: int) -> None:
        """As the dongle."""

    def close(self) -> None:
        """As the dongle."""


@pytest.fixture
def radio(tiny: TinyDrone, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[StallingRadio]]:
    """Such a radio in the place of every dongle; it works again when the test ends."""
    monkeypatch.setattr(cflib_radio.crazyradio, "Crazyradio", StallingRadio)
    monkeypatch.setattr(cflib_radio, "Crazyradio", StallingRadio)
    monkeypatch.setattr(cflib_radio.RadioManager, "_radios", [])
    # A busy machine may not let the radio's thread speak for seconds.
    monkeypatch.setattr(stop, "SILENT_S", PATIENCE_S)
    monkeypatch.setattr(stop, "LONGEST_S", PATIENCE_S)
    StallingRadio.drone = tiny
    yield StallingRadio
    works_again()


def works_again() -> None:
    """Everything is acknowledged."""
    for trouble in (StallingRadio.stalled, StallingRadio.faded, StallingRadio.pulled):
        trouble.clear()


@pytest.fixture
def driver(radio: type[StallingRadio]) -> Iterator[GuardedRadioDriver]:
    """A driver on such a radio."""
    opened = GuardedRadioDriver()
    opened.connect("radio://0/80/2M/E7E7E7E7E7", None, None)
    yield opened
    works_again()
    opened.stops_are_over()
    opened.close()


@pytest.fixture
def clock() -> StandingClock:
    """What :func:`flown` goes by: no machine is so busy that this drone falls silent."""
    return StandingClock()


@pytest.fixture
def flown(radio: type[StallingRadio], clock: StandingClock, tmp_path: Path) -> Iterator[DroneLink]:
    """A link over such a radio."""
    with DroneLink.open(
        URI,
        timeout_s=PATIENCE_S,
        reply_timeout_s=PATIENCE_S,
        clock=WallTime(clock),
        toc_cache=tmp_path,
    ) as link:
        yield link
        works_again()
        clock.now += 10.0 * PATIENCE_S  # a stop that did not come through must not go on for ever


def fade() -> None:
    """Acknowledge nothing, for longer than cflib waits."""
    StallingRadio.faded.set()
    begin = StallingRadio.unheard
    until(lambda: StallingRadio.unheard > begin + 2 * CFLIB_GIVES_UP)


def is_stopped(path: StopPath) -> bool:
    """Whether the stop that was triggered has reached the drone, and it said so."""
    return report_of(path).locked and STOP in StallingRadio.heard


def report_of(path: StopPath) -> stop.StopReport:
    """What came of a stop, also where time stands still."""
    until(lambda: path.report is not None)
    assert path.report is not None
    return path.report


def fill(driver: GuardedRadioDriver) -> None:
    """Stall the radio, with its queue of one full."""
    StallingRadio.stalled.set()
    while driver.send_packet(POSE):
        pass


class _NotedWaits(threading.Condition):
    """Notes how long its users are ready to wait, which no busy machine changes."""

    def __init__(self, lock: threading.Lock) -> None:
        super().__init__(lock)
        self.seconds: list[float | None] = []

    def wait(self, timeout: float | None = None) -> bool:
        """As ever."""
        self.seconds.append(timeout)
        return super().wait(timeout)


def give_pose(driver: GuardedRadioDriver) -> None:
    assert driver.send_packet(POSE) is False


def give_request(driver: GuardedRadioDriver) -> None:
    assert driver.send_packet(READ) is True


def ask_for_bits(driver: GuardedRadioDriver) -> None:
    CflibStopPort(driver).ask(b"\x90\x0c")


@pytest.mark.parametrize("send", [give_pose, give_request, ask_for_bits])
def test_no_send_waits_for_its_place_for_longer_than_its_bound(
    driver: GuardedRadioDriver, send: Callable[[GuardedRadioDriver], None]
) -> None:
    fill(driver)
    driver.out_queue.not_full = waits = _NotedWaits(driver.out_queue.mutex)
    begin = time.monotonic()
    send(driver)
    assert time.monotonic() - begin >= PROMISED_S, "it waits for its place"
    assert waits.seconds
    assert all(seconds is not None and seconds <= 1.01 * PROMISED_S for seconds in waits.seconds), (
        waits.seconds
    )


def test_a_request_is_sent_late_without_holding_up_its_sender(driver: GuardedRadioDriver) -> None:
    fill(driver)
    assert driver.send_packet(READ)
    assert driver.send_packet(ARM)
    assert bytes((0x21, 1, 0)) not in StallingRadio.heard
    StallingRadio.stalled.clear()
    until(lambda: {bytes((0x21, 1, 0)), bytes((0x91, 1, 1))} <= set(StallingRadio.heard))
    requests = [packet for packet in StallingRadio.heard if packet[0] != 0x61]
    assert requests == [bytes((0x21, 1, 0)), bytes((0x91, 1, 1))]


def test_a_stop_goes_out_before_everything_that_waits(driver: GuardedRadioDriver) -> None:
    fill(driver)
    driver.send_packet(READ)
    driver.send_packet(ARM)
    path = StopPath(CflibStopPort(driver))
    path.trigger()
    until(lambda: driver._kept_out_until > 0.0)
    assert driver.send_packet(POSE) is False
    before = len(StallingRadio.heard)
    StallingRadio.stalled.clear()
    assert is_stopped(path)
    after = StallingRadio.heard[before:]
    assert STOP in after[:2], "at most the packet that was on the air comes before the stop"
    assert bytes((0x91, 1, 1)) not in after
    path.close()


def test_the_driver_does_not_close_under_a_stop(driver: GuardedRadioDriver) -> None:
    fill(driver)
    path = StopPath(CflibStopPort(driver))
    path.trigger()
    until(lambda: driver._kept_out_until > 0.0)
    closing = threading.Thread(target=driver.close)
    closing.start()
    StallingRadio.stalled.clear()
    assert is_stopped(path)
    assert closing.is_alive(), "another stop can still come"
    path.close()
    closing.join(PATIENCE_S)
    assert not closing.is_alive()


def test_a_stop_in_a_fade_leaves_as_soon_as_the_radio_is_acknowledged(flown: DroneLink) -> None:
    """Which cflib gives up on long before any limit of ours."""
    flown.arm()
    fade()
    before = len(StallingRadio.heard)
    flown.stop_path.trigger()
    fade()
    assert STOP not in StallingRadio.heard
    works_again()
    assert is_stopped(flown.stop_path)
    assert STOP in StallingRadio.heard[before : before + 2], "at most what was on the air comes before it"
    assert flown.lost is None


def test_a_fade_shorter_than_the_limit_of_silence_costs_nothing(
    flown: DroneLink, clock: StandingClock
) -> None:
    fade()
    clock.now += 0.95
    fade()
    assert flown.lost is None
    works_again()
    assert flown.param("ring.solid") == 0.25
    assert flown.silence() == 0.0
    assert flown.lost is None


def test_a_drone_that_is_gone_is_lost_after_a_second_and_stopped_when_it_is_back(
    flown: DroneLink, clock: StandingClock
) -> None:
    flown.arm()
    fade()
    clock.now += 1.05
    until(lambda: flown.lost)
    assert "no packet for 1.05 s" in str(flown.lost)
    with pytest.raises(LinkLost, match="no packet for"):
        flown.param("ring.solid")
    flown.stop_path.trigger()
    fade()
    works_again()
    assert is_stopped(flown.stop_path)


def test_a_drone_that_stays_away_ends_the_stop_and_the_link(flown: DroneLink, clock: StandingClock) -> None:
    flown.arm()
    fade()
    clock.now += 1.05
    until(lambda: flown.lost)
    flown.stop_path.trigger()
    until(lambda: flown._crazyflie.link._kept_out_until > 0.0)
    clock.now += PATIENCE_S + 1.0  # as long as SILENT_S is here
    report = report_of(flown.stop_path)
    assert not report.locked
    assert "said nothing for" in report.reason
    flown.close()
    until(radio_is_closed)
    assert STOP not in StallingRadio.heard


def radio_is_closed() -> bool:
    """Whether cflib's thread has ended."""
    return all(thread.name != "RadioDriverThread" for thread in threading.enumerate())


def test_an_error_of_the_radio_is_told_at_once_and_does_not_take_the_stop_with_it(
    flown: DroneLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever closes cflib's link: the radio is closed when no stop can come any more."""
    flown.arm()
    broken = threading.Event()
    broken.set()
    send = cflib_radio._SharedRadioInstance.send_packet

    def breaks(instance: cflib_radio._SharedRadioInstance, data: Sequence[int]) -> _Answer | None:
        if broken.is_set():
            time.sleep(0.001)
            raise OSError("no such device")
        answer: _Answer | None = send(instance, data)
        return answer

    with monkeypatch.context() as patched:
        patched.setattr(cflib_radio._SharedRadioInstance, "send_packet", breaks)
        until(lambda: flown.lost)  # the clock stands: nothing but the error says so
        assert "unplugged" in str(flown.lost)
        broken.clear()
        flown.stop_path.trigger()
        assert is_stopped(flown.stop_path)
    flown.close()
    until(radio_is_closed)


def test_a_pulled_dongle_is_lost_as_a_silent_drone_is(flown: DroneLink, clock: StandingClock) -> None:
    """cflib 0.1.34 catches the error of USB: nobody hears of it."""
    StallingRadio.pulled.set()
    until(lambda: StallingRadio.unheard > 2 * CFLIB_GIVES_UP)
    assert flown.lost is None
    clock.now += 1.05
    until(lambda: flown.lost)
    assert "no packet for 1.05 s" in str(flown.lost)
    flown.close()
    until(radio_is_closed)


def test_a_drone_that_is_not_there_is_told_before_any_deadline(
    radio: type[StallingRadio], tmp_path: Path
) -> None:
    """While nothing is connected nothing flies, and no stop can come."""
    radio.faded.set()
    with pytest.raises(
        LinkError, match=r"^no drone at radio://.*: Too many packets lost\. Is it on"
    ) as caught:
        DroneLink.open(URI, timeout_s=PATIENCE_S, toc_cache=tmp_path)
    assert URI in str(caught.value)
    until(radio_is_closed)


def test_the_stop_of_another_process_goes_on_through_a_fade(radio: type[StallingRadio]) -> None:
    radio.faded.set()
    reports: list[stop.StopReport] = []
    stopping = threading.Thread(target=lambda: reports.append(stop_drone(URI)))
    stopping.start()
    fade()
    works_again()
    stopping.join(PATIENCE_S)
    assert [report.locked for report in reports] == [True]
    assert STOP in radio.heard
    until(radio_is_closed)


def test_a_missing_radio_is_one_error_without_a_traceback(caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(LinkError, match=r"^cannot open radio://98/.*is a Crazyradio plugged in") as error:
        DroneLink.open("radio://98/80/2M/E7E7E7E7E7")
    assert "\n" not in str(error.value)
    assert "Traceback" not in caplog.text
