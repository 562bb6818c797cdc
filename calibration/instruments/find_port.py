"""Finds the port of an instrument: by unplugging it, or by asking every port who is there."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from serial.tools import list_ports

from calibration.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentNotFound,
)
from calibration.instruments.line_device import HANDSHAKE_S, ask_banner
from calibration.instruments.protocol import Banner, Kind
from onboard.clock import Clock, monotonic


@dataclass(frozen=True, slots=True)
class PortAnswer:
    """What a port said when it was asked: its banner, or why there is none."""

    device: str
    banner: Banner | None
    trouble: str


def serial_ports() -> list[str]:
    """Names of the serial ports of this computer, sorted."""
    return sorted(port.device for port in list_ports.comports())


def find_by_unplugging(
    wait_for_unplugged: Callable[[], None], ports: Callable[[], Sequence[str]] = serial_ports
) -> str:
    """The port that vanishes when the operator unplugs the instrument.

    Args:
        wait_for_unplugged: asks the operator to unplug it and returns when that is done.
        ports: lists the ports.

    Raises:
        InstrumentNotFound: no port vanished, or more than one.
    """
    before = set(ports())
    wait_for_unplugged()
    gone = sorted(before - set(ports()))
    if len(gone) == 1:
        return gone[0]
    if not gone:
        seen = ", ".join(sorted(before)) or "none"
        raise InstrumentNotFound(
            f"no port vanished (there were: {seen}): was it plugged in, is its cable for data?"
        )
    raise InstrumentNotFound(f"several ports vanished ({', '.join(gone)}): unplug the instrument alone")


def ask_ports(
    devices: Sequence[str], *, within_s: float = HANDSHAKE_S, clock: Clock = monotonic
) -> list[PortAnswer]:
    """Ask each port in turn for its banner; at most `within_s` [s] each. Other devices than ours may not like
    to get a ``?``: name them only when they are expected to be ours."""
    answers = []
    for device in devices:
        try:
            answers.append(PortAnswer(device, ask_banner(device, within_s=within_s, clock=clock), ""))
        except InstrumentError as error:
            answers.append(PortAnswer(device, None, str(error)))
    return answers


def find_instrument(
    kind: Kind, devices: Sequence[str], *, within_s: float = HANDSHAKE_S, clock: Clock = monotonic
) -> str:
    """The one port with an instrument of this kind.

    Raises:
        InstrumentNotFound: none, with what each port said. InstrumentInputError: several.
    """
    answers = ask_ports(devices, within_s=within_s, clock=clock)
    fitting = [
        answer.device for answer in answers if answer.banner is not None and answer.banner.kind is kind
    ]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise InstrumentInputError(f"several instruments fit: {', '.join(fitting)}; name the one you mean")
    said = "; ".join(answer.trouble or f"{answer.device} is something else of ours" for answer in answers)
    raise InstrumentNotFound(
        f"no {kind.name.lower().replace('_', ' ')} found: {said or 'there is no serial port'}"
    )
