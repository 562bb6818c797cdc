"""The power switch: reboots the drone's main processor through the radio chip (or through a simulated
drone's).

CRTP header ``FF`` (port 15, channel 3) with ``FE 02`` turns the processor and all decks off, ``FE 03`` on.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cflib.crtp
from cflib.crtp.crtpstack import CRTPPacket
from cflib.utils.power_switch import PowerSwitch

from onboard.lab_time import open_timebase
from onboard.link.driver import install_driver, links_live_in
from onboard.link.errors import DroneIsFlying, LinkError, LinkInputError, LinkTimeout
from onboard.link.exclusive import hold
from onboard.link.uri import check_drone_uri, stop_command
from onboard.supervisor_info import SupervisorInfo
from onboard.timebase import Timebase

_BOOTLOADER_HEADER, _BOOTLOADER_COMMAND, _OFF, _ON = 0xFF, 0xFE, 0x02, 0x03
_LINK_SOURCE_HEADER = 0xF1
_INFO_HEADER, _GET_INFO, _INFO = 0x90, 0x0C, 0x8C
_REPEAT_S = 0.1
_OFF_TIME_S = 0.5
_ANSWER_S = 1.0
_ASK_AGAIN_S = 0.5
_SETTLED_S = 3.0
"""A drone says that it flies until its thrust has been off for 2 s."""


def reboot(uri: str, timeout_s: float = 10.0, *, even_flying: bool = False) -> None:
    """Switch the drone off and on, and return when its firmware answers again.

    Whatever it held in memory is gone: parameters, policy, log blocks. A connection that is open meanwhile is
    lost. Over the radio cflib's own power switch does the switching.

    Args:
        uri: where the drone is.
        timeout_s: deadline for the switching.
        even_flying: to stop motors. Else a drone that says that it flies is left alone. One that says
            nothing is rebooted: its firmware hangs.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to the drone.
        DroneIsFlying: it flies; it was not rebooted.
        LinkError: there is no radio, or nobody is there.
        LinkTimeout: the drone did not answer before or after.
    """
    check_drone_uri(uri)
    install_driver()
    with hold(uri), open_timebase("reboot", uri) as time:
        if not even_flying:
            refuse_flying(uri, time)
        deadline = time() + timeout_s
        if uri.startswith("udp://"):
            with _raw_link(uri, time) as link:
                link.until_answered(_BOOTLOADER_HEADER, bytes((_BOOTLOADER_COMMAND, _OFF)), deadline)
                time.event().wait(_OFF_TIME_S)
                link.until_answered(_BOOTLOADER_HEADER, bytes((_BOOTLOADER_COMMAND, _ON)), deadline)
        else:
            with _cflib_errors(uri):
                switch = PowerSwitch(uri)
                switch.stm_power_down()
                time.event().wait(_OFF_TIME_S)
                switch.stm_power_up()
                switch.close()
        with _raw_link(uri, time) as link:
            link.until_answered(_LINK_SOURCE_HEADER, b"\0", deadline)


def refuse_flying(uri: str, time: Timebase) -> None:
    """Refuse a drone that says that it flies: even to connect to it takes its telemetry from who flies it.

    It may have landed just now, so it is asked again for 3 s. One that does not answer is not refused: who
    connects to it hears why.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneIsFlying: it flies.
    """
    check_drone_uri(uri)
    install_driver()
    settled = time() + _SETTLED_S
    while _says_that_it_flies(uri, time):
        if time() > settled:
            raise DroneIsFlying(
                f"{uri} says that it is flying, and is left alone: somebody else flies it. "
                f"Wait until it has landed, or stop it with {stop_command(uri)}"
            )
        time.event().wait(_ASK_AGAIN_S)


def _says_that_it_flies(uri: str, time: Timebase) -> bool:
    """What the drone's supervisor answers; False when nothing does."""
    said = _supervisor_info(uri, time)
    return said is not None and said.is_flying


def ask_supervisor(uri: str) -> SupervisorInfo | None:
    """What the drone's supervisor answers to who is not connected; None when nothing does within 1 s.

    Raises:
        LinkInputError: the URI cannot be used.
        DroneInUse: another process talks to the drone.
    """
    check_drone_uri(uri)
    install_driver()
    with hold(uri), open_timebase("ask", uri) as time:
        return _supervisor_info(uri, time)


def _supervisor_info(uri: str, time: Timebase) -> SupervisorInfo | None:
    try:
        with _raw_link(uri, time) as link:
            answer = link.until_answered(_INFO_HEADER, bytes((_GET_INFO,)), time() + _ANSWER_S)
    except LinkInputError:
        raise
    except LinkError:
        return None
    told = len(answer) >= 3 and answer[0] == _INFO
    return SupervisorInfo(int.from_bytes(answer[1:3], "little")) if told else None


@contextmanager
def _cflib_errors(uri: str) -> Iterator[None]:
    """Turn whatever cflib's radio code raises into an error with the address in it."""
    try:
        yield
    except Exception as error:  # cflib raises bare exceptions here, there is nothing narrower
        raise LinkError(f"cannot reboot {uri}: {error}") from error


@contextmanager
def _raw_link(uri: str, time: Timebase) -> Iterator["_RawLink"]:
    """A link without a connection on it."""
    errors: list[str] = []
    with _cflib_errors(uri), links_live_in(uri, time):
        driver = cflib.crtp.get_link_driver(uri, None, errors.append)
    if driver is None:
        raise LinkInputError(f"no driver for {uri!r}; write udp://HOST:PORT, radio://... or usb://...")
    try:
        yield _RawLink(uri, driver, errors, time)
    finally:
        driver.close()


@dataclass(frozen=True, slots=True)
class _RawLink:
    uri: str
    driver: Any
    errors: list[str]
    time: Timebase

    def until_answered(self, header: int, payload: bytes, deadline: float) -> bytes:
        """Send a request until a packet of the same port and channel comes back; its payload.

        Raises:
            LinkError: the driver reported an error.
            LinkTimeout: no answer by ``deadline``.
        """
        packet = CRTPPacket(header, payload)
        while self.time() < deadline:
            self.driver.send_packet(packet)
            until = self.time() + _REPEAT_S
            while self.time() < until:
                answer = self.driver.receive_packet(_REPEAT_S)
                if self.errors:
                    raise LinkError(f"cannot reboot {self.uri}: {self.errors[0]}")
                if answer is not None and (answer.port, answer.channel) == (packet.port, packet.channel):
                    return bytes(answer.data)
        raise LinkTimeout(f"cannot reboot {self.uri}: no answer to header {header:#04x} by the deadline")
