"""The power switch: reboots the drone's main processor through the radio chip (or through a simulated
drone's).

CRTP header ``FF`` (port 15, channel 3) with ``FE 02`` turns the processor and all decks off, ``FE 03`` on.
"""

import threading
import time
from typing import Any

import cflib.crtp
from cflib.crtp.crtpstack import CRTPPacket

from onboard.clock import Clock
from onboard.link.driver import install_driver
from onboard.link.errors import LinkError, LinkTimeout

_BOOTLOADER_HEADER, _BOOTLOADER_COMMAND, _OFF, _ON = 0xFF, 0xFE, 0x02, 0x03
_LINK_SOURCE_HEADER = 0xF1
_REPEAT_S = 0.1
_OFF_TIME_S = 0.5


def reboot(uri: str, timeout_s: float = 10.0, clock: Clock = time.monotonic) -> None:
    """Switch the drone off and on, and return when its firmware answers again.

    Whatever it held in memory is gone: parameters, policy, log blocks. A connection that is open meanwhile is
    lost.

    Raises:
        LinkError: the URI has no driver, or nobody is there.
        LinkTimeout: the drone did not answer before or after.
    """
    install_driver()
    errors: list[str] = []
    link = cflib.crtp.get_link_driver(uri, None, errors.append)
    if link is None:
        raise LinkError(f"no driver for {uri!r}; write udp://HOST:PORT, radio://... or usb://...")
    deadline = clock() + timeout_s
    try:
        _until_answered(link, (_BOOTLOADER_HEADER, _OFF), uri, deadline, clock, errors)
        threading.Event().wait(_OFF_TIME_S)
        _until_answered(link, (_BOOTLOADER_HEADER, _ON), uri, deadline, clock, errors)
        _until_answered(link, (_LINK_SOURCE_HEADER, None), uri, deadline, clock, errors)
    finally:
        link.close()


def _until_answered(
    link: Any, request: tuple[int, int | None], uri: str, deadline: float, clock: Clock, errors: list[str]
) -> None:
    """Send a request until a packet of the same port and channel comes back."""
    header, command = request
    payload = b"\0" if command is None else bytes((_BOOTLOADER_COMMAND, command))
    packet = CRTPPacket(header, payload)
    while clock() < deadline:
        link.send_packet(packet)
        until = clock() + _REPEAT_S
        while clock() < until:
            answer = link.receive_packet(_REPEAT_S)
            if errors:
                raise LinkError(f"cannot reboot {uri}: {errors[0]}")
            if answer is not None and (answer.port, answer.channel) == (packet.port, packet.channel):
                return
    raise LinkTimeout(f"cannot reboot {uri}: no answer to header {header:#04x} by the deadline")
