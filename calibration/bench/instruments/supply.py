"""Laboratory supplies. The output is off after every way out of a ``with`` block.

:class:`ScpiSupply` speaks SCPI (``VOLT``, ``CURR``, ``OUTP``, ``MEAS:...``), :class:`KoradSupply` the terse
dialect of Korad and its many copies: no line ends, and 50 ms of rest between commands.
"""

import itertools
import math
import re
import time
from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

from calibration.bench.instruments.conversation import Conversation
from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentRefused,
    WrongDevice,
)
from onboard.clock import Clock, monotonic
from onboard.closing import Closing

SCPI_BAUD, KORAD_BAUD = 9_600, 9_600
#: A current within this of the limit, with a voltage below the set one, is current limiting.
_LIMIT_SHARE, _LIMIT_SAG_V = 0.97, 0.03
_KORAD_REST_S = 0.06
_QUEUE_MAX = 32
#: Bits of Korad's one-byte status.
_KORAD_CONSTANT_VOLTAGE, _KORAD_OUTPUT = 0x01, 0x40
OFF_BY_HAND = "SWITCH THE SUPPLY OFF BY HAND"
_PLAIN = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?|[+-]?\.\d+")


@dataclass(frozen=True, slots=True)
class SupplyReading:
    """What the supply measures at its terminals.

    Attributes:
        voltage: V.
        current: A.
        limited: it limits the current: its voltage is not the one that was set.
        time: host clock [s].
    """

    voltage: float
    current: float
    limited: bool
    time: float


class Supply(Protocol):
    """What a wizard needs of a supply; :class:`SerialSupply` says what each call does and raises."""

    @property
    def device(self) -> str:
        """Name of its port."""

    @property
    def typed(self) -> bool:
        """Whether a person sets and reads it, who cannot type at the same time."""

    def set(self, voltage: float, current_limit: float) -> None:
        """Set voltage [V] and current limit [A]; does not switch on."""

    def switch(self, on: bool) -> None:
        """Switch the output on or off."""

    def measure(self) -> SupplyReading:
        """Measure voltage and current now."""

    def close(self) -> None:
        """Switch the output off and let go; idempotent."""


class OffWhenClosed(Closing):
    """An open supply; a context manager that switches the output off before it lets go.

    Attributes:
        device: name of its port.
    """

    device: str
    _closed = False

    def close(self) -> None:
        """Switch the output off and let go; idempotent.

        Raises:
            InstrumentError: the output could not be switched off: do it by hand.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._last_switch_off()
        except InstrumentError as error:
            raise InstrumentError(f"{OFF_BY_HAND}: {self.device} did not obey ({error})") from error
        finally:
            self._let_go()

    @abstractmethod
    def _last_switch_off(self) -> None:
        """Raises InstrumentError where it is not known to be off."""

    @abstractmethod
    def _let_go(self) -> None:
        """Of the port, whether it is off or not."""


class SerialSupply(OffWhenClosed):
    """A supply at the port of this process."""

    def __init__(self, conversation: Conversation, clock: Clock) -> None:
        self.device = conversation.device
        self._conversation = conversation
        self._clock = clock
        self.identity = ""
        self._voltage = self._limit = 0.0

    def set(self, voltage: float, current_limit: float) -> None:
        """Set voltage [V] and current limit [A]; does not switch on.

        Raises:
            InstrumentInputError: negative or not finite.
            InstrumentRefused: the supply says no (out of its range).
            InstrumentTimeout, InstrumentLost.
        """
        for name, value in (("voltage", voltage), ("current limit", current_limit)):
            if not math.isfinite(value) or value < 0.0:
                raise InstrumentInputError(
                    f"{name} {value} of the supply: a number of zero or more is needed"
                )
        self._set(voltage, current_limit)
        self._voltage, self._limit = voltage, current_limit

    @abstractmethod
    def switch(self, on: bool) -> None:
        """Switch the output on or off."""

    @abstractmethod
    def cut(self) -> None:
        """Say off and wait for no answer; also from another thread, beside a call that hangs.

        Whether it obeyed is not known: :meth:`switch` it off afterwards.

        Raises:
            InstrumentLost: unplugged.
        """

    @abstractmethod
    def measure(self) -> SupplyReading:
        """Measure voltage and current now."""

    @abstractmethod
    def _set(self, voltage: float, current_limit: float) -> None: ...

    def _last_switch_off(self) -> None:
        self.switch(on=False)

    def _let_go(self) -> None:
        self._conversation.close()

    def _limited(self, voltage: float, current: float) -> bool:
        return (
            self._limit > 0.0
            and current >= _LIMIT_SHARE * self._limit
            and voltage < self._voltage - _LIMIT_SAG_V
        )


class ScpiSupply(SerialSupply):
    """A supply with SCPI commands. After every command its error queue is read.

    Attributes:
        errors_at_open: what was in its error queue before we came.
    """

    def __init__(self, address: str, *, clock: Clock = monotonic) -> None:
        """Open it, ask who it is, empty its error queue.

        Raises:
            InstrumentInputError, InstrumentNotFound, InstrumentTimeout, WrongBaudRate, WrongDevice.
        """
        super().__init__(Conversation(address, SCPI_BAUD, clock=clock), clock)
        try:
            self.identity = self._conversation.ask_line(b"*IDN?\n")
            if self.identity.count(",") < 1:
                raise WrongDevice(f"{self.device} is no SCPI supply: it answers {self.identity[:40]!r}")
            self.errors_at_open = self._old_errors()
        except BaseException:
            self._conversation.close()
            raise

    def switch(self, on: bool) -> None:
        """Switch the output; errors as for :meth:`set`."""
        self._command("OUTP ON" if on else "OUTP OFF")

    def cut(self) -> None:
        """See :meth:`SerialSupply.cut`."""
        self._conversation.tell(b"OUTP OFF\n")

    def measure(self) -> SupplyReading:
        """Measure at the terminals.

        Raises:
            InstrumentRefused: an answer that is no number.
            InstrumentTimeout, InstrumentLost.
        """
        voltage = self._number("MEAS:VOLT?")
        current = self._number("MEAS:CURR?")
        return SupplyReading(voltage, current, self._limited(voltage, current), self._clock())

    def _set(self, voltage: float, current_limit: float) -> None:
        self._command(f"VOLT {voltage:.4f}")
        self._command(f"CURR {current_limit:.4f}")

    def _command(self, command: str) -> None:
        self._conversation.tell(command.encode("ascii") + b"\n")
        error = self._error()
        if error is not None:
            raise InstrumentRefused(f"{self.device} refuses {command!r}: {error}")

    def _old_errors(self) -> tuple[str, ...]:
        """Empty the queue; a device that never runs out of errors is left alone after a while."""
        return tuple(itertools.takewhile(bool, (self._error() or "" for _ in range(_QUEUE_MAX))))

    def _error(self) -> str | None:
        """The oldest entry of the error queue, or None when it is empty."""
        answer = self._conversation.ask_line(b"SYST:ERR?\n")
        number = answer.partition(",")[0].strip()
        return None if number.lstrip("+-") == "0" else answer

    def _number(self, question: str) -> float:
        answer = self._conversation.ask_line(question.encode("ascii") + b"\n")
        return _plain_number(self.device, question, answer)


class KoradSupply(SerialSupply):
    """A Korad-type supply. It says itself whether it limits the current."""

    def __init__(self, address: str, *, clock: Clock = monotonic) -> None:
        """Open it and ask who it is; errors as for :class:`ScpiSupply`."""
        super().__init__(Conversation(address, KORAD_BAUD, clock=clock), clock)
        try:
            identity = self._ask(b"*IDN?")
            if not identity.isascii() or not identity.strip(b"\0\r\n "):
                raise WrongDevice(f"{self.device} is no Korad-type supply: it answers {identity[:40]!r}")
            self.identity = identity.decode("ascii").strip("\0\r\n ")
        except BaseException:
            self._conversation.close()
            raise

    def switch(self, on: bool) -> None:
        """Switch the output and read back that it did.

        Raises:
            InstrumentRefused: it did not.
            InstrumentTimeout, InstrumentLost.
        """
        self._tell(b"OUT1" if on else b"OUT0")
        if bool(self._status() & _KORAD_OUTPUT) is not on:
            raise InstrumentRefused(f"{self.device} did not switch its output {'on' if on else 'off'}")

    def cut(self) -> None:
        """See :meth:`SerialSupply.cut`; it hears nothing within 50 ms of another command."""
        time.sleep(_KORAD_REST_S)
        self._tell(b"OUT0")

    def measure(self) -> SupplyReading:
        """Measure at the terminals; errors as for :meth:`ScpiSupply.measure`."""
        voltage = self._number("VOUT1?")
        current = self._number("IOUT1?")
        status = self._status()
        limited = bool(status & _KORAD_OUTPUT) and not status & _KORAD_CONSTANT_VOLTAGE
        return SupplyReading(voltage, current, limited, self._clock())

    def _set(self, voltage: float, current_limit: float) -> None:
        """It has no error queue: read the settings back. A lower current limit than asked for is the most
        that it has (5 A of many): it says itself when it limits."""
        for name, value, digits in (("VSET1", voltage, 2), ("ISET1", current_limit, 3)):
            self._tell(f"{name}:{value:.{digits}f}".encode("ascii"))
            taken = self._number(f"{name}?")
            most_it_has = name == "ISET1" and 0.0 < taken < value
            if abs(taken - value) > 0.6 * 10.0**-digits and not most_it_has:
                raise InstrumentRefused(
                    f"{self.device} took {name} = {taken} instead of {value}: out of its range"
                )

    def _status(self) -> int:
        return self._ask(b"STATUS?", 1)[0]

    def _number(self, question: str) -> float:
        answer = self._ask(question.encode("ascii")).decode("ascii", "replace")
        return _plain_number(self.device, question, answer.strip("\0\r\n "))

    def _ask(self, question: bytes, length: int | None = None) -> bytes:
        answer = self._conversation.ask_unterminated(question, length)
        time.sleep(_KORAD_REST_S)
        return answer

    def _tell(self, command: bytes) -> None:
        self._conversation.tell(command)
        time.sleep(_KORAD_REST_S)


def _plain_number(device: str, question: str, answer: str) -> float:
    if not _PLAIN.fullmatch(answer):
        raise InstrumentRefused(f"{device} answers {question!r} with {answer!r}, which is no number")
    return float(answer)
