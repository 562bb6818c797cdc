"""The radio driver's bounds, on cflib's own threads above a radio that stalls when told."""

import threading
import time
from collections.abc import Iterator, Sequence
from typing import ClassVar

import cflib.crtp.radiodriver as cflib_radio
import pytest
from cflib.crtp.crtpstack import CRTPPacket

from onboard.link import DroneLink, stop
from onboard.link.errors import LinkError
from onboard.link.radio import SEND_S, CflibStopPort, GuardedRadioDriver
from onboard.link.stop import StopPath
from tests.patience import PATIENCE_S, until

POSE, READ, ARM = CRTPPacket(0x61, b"\x08" * 29), CRTPPacket(0x21, b"\x01\x00"), CRTPPacket(0x91, b"\x01\x01")
SAFELINK = (0xFF, 0x05, 0x01)


class _Answer:
    def __init__(self, data: Sequence[int]) -> None:
        self.ack, self.data, self.powerDet, self.retry = True, tuple(data), False, 0


class StallingRadio:
    """The dongle: acknowledges every packet, unless it is stalled; the drone locks when it is stopped."""

    DR_2MPS = 2
    stalled = threading.Event()
    heard: ClassVar[list[bytes]] = []

    def __init__(self, devid: int = 0) -> None:
        self.version = 0.5
        StallingRadio.stalled.clear()
        StallingRadio.heard = []
        self._locked = False

    def send_packet(self, data: Sequence[int]) -> _Answer:
        """One exchange on the air."""
        while StallingRadio.stalled.is_set():
            time.sleep(0.001)
        packet = bytes(data)
        if tuple(packet) == SAFELINK:
            return _Answer(SAFELINK)
        packet = bytes((packet[0] & 0xF3, *packet[1:]))
        if packet != b"\xf3":
            StallingRadio.heard.append(packet)
        self._locked |= packet == b"\x91\x03"
        return _Answer((0x90, 0x8C, 0x40 if self._locked else 0x00, 0x00) if packet == b"\x90\x0c" else ())

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
def driver(monkeypatch: pytest.MonkeyPatch) -> Iterator[GuardedRadioDriver]:
    """A driver on such a radio."""
    monkeypatch.setattr(cflib_radio.crazyradio, "Crazyradio", StallingRadio)
    monkeypatch.setattr(cflib_radio, "Crazyradio", StallingRadio)
    monkeypatch.setattr(cflib_radio.RadioManager, "_radios", [])
    # A busy machine may not let the radio's thread speak for seconds.
    monkeypatch.setattr(stop, "SILENT_S", PATIENCE_S)
    monkeypatch.setattr(stop, "LONGEST_S", PATIENCE_S)
    opened = GuardedRadioDriver()
    opened.connect("radio://0/80/2M/E7E7E7E7E7", None, None)
    yield opened
    StallingRadio.stalled.clear()
    opened.close()


def fill(driver: GuardedRadioDriver) -> None:
    """Stall the radio, with its queue of one full."""
    StallingRadio.stalled.set()
    while driver.send_packet(POSE):
        pass


def test_a_pose_that_finds_no_place_is_given_up_within_its_bound(driver: GuardedRadioDriver) -> None:
    fill(driver)
    begin = time.monotonic()
    assert driver.send_packet(POSE) is False
    assert time.monotonic() - begin >= SEND_S


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
    report = path.wait(PATIENCE_S)
    assert report is not None
    assert report.locked
    after = StallingRadio.heard[before:]
    assert b"\x91\x03" in after[:2], "at most the packet that was on the air comes before the stop"
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
    report = path.wait(PATIENCE_S)
    closing.join()
    path.close()
    assert report is not None
    assert report.locked


def test_a_missing_radio_is_one_error_without_a_traceback(caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(LinkError, match=r"^cannot open radio://98/.*is a Crazyradio plugged in") as error:
        DroneLink.open("radio://98/80/2M/E7E7E7E7E7")
    assert "\n" not in str(error.value)
    assert "Traceback" not in caplog.text
