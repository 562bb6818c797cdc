"""One serial port: opened exclusively, read with a deadline, and lost with a message. Wraps pyserial."""

import errno
import urllib.parse
from dataclasses import dataclass
from typing import Self

import serial

from calibration.bench.instruments.errors import InstrumentInputError, InstrumentLost, InstrumentNotFound
from onboard.closing import Closing

#: No read and no write blocks longer [s].
IO_TIMEOUT_S = 1.0
#: A device that is asked has answered by then, if its address does not say otherwise [s].
ANSWER_S = 1.0
_ANSWER_S_MAX = 60.0


@dataclass(frozen=True, slots=True)
class Address:
    """Where an instrument is.

    Attributes:
        device: "/dev/ttyACM0", "COM3".
        baud: speed [baud].
        answer_s: how long an answer may take [s].
    """

    device: str
    baud: int
    answer_s: float = ANSWER_S

    @classmethod
    def parse(cls, text: str, default_baud: int) -> Self:
        """``serial:///dev/...?baud=N&answer_s=SECONDS``, or just what stands behind ``serial://``.

        Raises:
            InstrumentInputError: another scheme, no device, or a speed or a time that is no positive number.
        """
        if not text:
            raise InstrumentInputError("empty address: write serial:///dev/ttyACM0 or /dev/ttyACM0")
        if "://" not in text and "?" not in text:
            return cls(text, default_baud)
        parts = urllib.parse.urlsplit(text if "://" in text else f"serial://{text}")
        device = parts.netloc + urllib.parse.unquote(parts.path)
        query = urllib.parse.parse_qs(parts.query, keep_blank_values=True)
        baud = query.pop("baud", [str(default_baud)])[-1]
        answer_s = query.pop("answer_s", [str(ANSWER_S)])[-1]
        if parts.scheme != "serial" or not device or query:
            raise InstrumentInputError(
                f"{text!r} is no serial address: write serial:///dev/ttyACM0?baud=115200"
            )
        if not (baud.isascii() and baud.isdigit() and 0 < int(baud) <= 4_000_000):
            raise InstrumentInputError(
                f"baud={baud!r} in {text!r} is no speed: write for example baud=115200"
            )
        return cls(device, int(baud), _seconds(answer_s, text))


class SerialPort(Closing):
    """An open port; a context manager.

    Setting DTR is left to the driver of the operating system: it is set when a port opens (and resets a board
    of the Uno class), and pseudo-terminals, which have no DTR, are accepted.
    """

    def __init__(self, address: Address) -> None:
        """Open it.

        Raises:
            InstrumentNotFound: it does not exist, is not ours to open, or is in use.
        """
        self.address = address
        try:
            self._serial = serial.Serial(
                address.device,
                address.baud,
                timeout=IO_TIMEOUT_S,
                write_timeout=IO_TIMEOUT_S,
                exclusive=True,
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise InstrumentNotFound(_opening_text(address, error)) from error

    def read(self, within_s: float = IO_TIMEOUT_S) -> bytes:
        """What has arrived; waits up to `within_s` [s, at most 1] for the first byte, empty if none came.

        Raises:
            InstrumentLost: unplugged.
        """
        timeout = min(max(within_s, 0.0), IO_TIMEOUT_S)
        try:
            if self._serial.timeout != timeout:
                self._serial.timeout = timeout
            first = self._serial.read(1)
            if not first:
                return b""
            waiting = self._serial.in_waiting
            return bytes(first + self._serial.read(waiting)) if waiting else bytes(first)
        except (serial.SerialException, OSError, TypeError) as error:
            # pyserial raises TypeError when another thread closes the port under a read.
            raise InstrumentLost(f"{self.address.device} is gone ({error}): unplugged?") from error

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            InstrumentLost: unplugged, or nobody takes the bytes within 1 s.
        """
        try:
            self._serial.write(data)
        except (serial.SerialException, OSError, TypeError) as error:
            raise InstrumentLost(
                f"{self.address.device} takes no more bytes ({error}): unplugged?"
            ) from error

    def discard(self) -> None:
        """Forget what has arrived and was not read.

        Raises:
            InstrumentLost: unplugged.
        """
        try:
            self._serial.read(self._serial.in_waiting)
        except (serial.SerialException, OSError) as error:
            raise InstrumentLost(f"{self.address.device} is gone ({error}): unplugged?") from error

    def close(self) -> None:
        """Close it; idempotent."""
        self._serial.close()


def _seconds(value: str, text: str) -> float:
    try:
        seconds = float(value)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds <= _ANSWER_S_MAX:  # nor is "nan"
        raise InstrumentInputError(
            f"answer_s={value!r} in {text!r} is no time: write more than 0 and at most {_ANSWER_S_MAX:g} (s)"
        )
    return seconds


def _opening_text(address: Address, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return f"there is no port {address.device}: is it plugged in? Unplugging it tells its name"
    if number in (errno.EACCES, errno.EPERM):
        return f"{address.device} may not be opened: add yourself to the group that owns it (dialout or uucp)"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{address.device} is in use by another program: close it (serial monitor, another wizard)"
    return f"{address.device} does not open at {address.baud} baud: {error}"
