"""The tachometer of the paper's authors: ``millis, omega`` lines at 9600 baud.

Its speed is an average over a window of 51 to 76 ms, counted in whole edges (one edge more or less is 41 to
62 rad/s). That is too slow to claim a time constant of 50 ms; everything from here is marked
:data:`WINDOW_AVERAGED`. There is no checksum: a line counts when both numbers and the step are plausible.
"""

import re
from collections import Counter
from dataclasses import dataclass
from enum import Enum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibration.instruments.diagnosis import text_share
from calibration.instruments.errors import InstrumentLost, InstrumentTimeout, WrongBaudRate, WrongDevice
from calibration.instruments.mailbox import Mailbox
from calibration.instruments.reader import Reader, Reconnect
from calibration.instruments.transport import IO_TIMEOUT_S, Address, SerialPort
from onboard.clock import Clock, monotonic

BAUD = 9_600
WINDOW_AVERAGED = "window-averaged"
#: Fastest believable speed [rad/s]; small brushed motors end at 3200.
OMEGA_MAX = 5_000.0
#: Longest step between two lines [ms]; the sketch sends one every 51 to 76 ms.
STEP_MAX_MS = 1_000
SILENCE_MAX_S = 1.0
_LINE_BYTES_MAX = 40
_LINE = re.compile(rb"(\d{1,10}), ?(\d{1,5}(?:\.\d{1,4})?)")
_SAMPLES_MAX = 20_000
_OPENING_S = 4.0


class LegacyFault(Enum):
    """Why a line was thrown away."""

    FORMAT = "format"
    SPEED = "speed out of range"
    TIME = "time out of order"


@dataclass(frozen=True, slots=True)
class LegacySample:
    """One window: end on the device's clock [s], mean speed [rad/s], receipt [s, host], restarts so far."""

    time: float
    omega: float
    receipt: float
    epoch: int


class LegacyParser:
    """Bytes in, samples and counted faults out. Pure.

    A time that jumps is believed when the next line continues it (the board was reset), else it is a fault.
    """

    def __init__(self) -> None:
        self.faults: Counter[LegacyFault] = Counter()
        self.restarts = 0
        self._rest = b""
        self._last_ms: int | None = None
        self._jumped: tuple[int, float] | None = None

    def feed(self, data: bytes, receipt: float) -> list[LegacySample]:
        """Take bytes that arrived at `receipt` [s, host]; the samples that they complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _LINE_BYTES_MAX:
            self._rest = b"\0"  # the end of a line that is too long must not look like a line
        samples = []
        for line in lines:
            sample = self._take(line.removesuffix(b"\r"), receipt)
            if sample is not None:
                samples.append(sample)
        return samples

    def _take(self, line: bytes, receipt: float) -> LegacySample | None:
        if not line:
            return None
        match = _LINE.fullmatch(line)
        if match is None:
            self.faults[LegacyFault.FORMAT] += 1
            return None
        millis, omega = int(match[1]), float(match[2])
        if omega > OMEGA_MAX:
            self.faults[LegacyFault.SPEED] += 1
            return None
        return self._in_order(millis, omega, receipt)

    def _in_order(self, millis: int, omega: float, receipt: float) -> LegacySample | None:
        last, jumped, self._jumped = self._last_ms, self._jumped, None
        if last is not None and not 0 < millis - last <= STEP_MAX_MS:
            if jumped is None or not 0 < millis - jumped[0] <= STEP_MAX_MS:
                self._jumped = (millis, omega)
                self.faults[LegacyFault.TIME] += 1
                return None
            self.restarts += 1
        self._last_ms = millis
        return LegacySample(1e-3 * millis, omega, receipt, self.restarts)


class LegacyTachometer:
    """An open legacy tachometer; a context manager.

    Attributes:
        label: says in every result what these speeds are.
    """

    label = WINDOW_AVERAGED

    def __init__(self, address: str, *, clock: Clock = monotonic, reconnect: Reconnect | None = None) -> None:
        """Open it and wait for its first line.

        Raises:
            InstrumentInputError, InstrumentNotFound, InstrumentTimeout, WrongBaudRate, WrongDevice.
        """
        port = SerialPort(Address.parse(address, BAUD))
        self._clock = clock
        self._parser = LegacyParser()
        self._box: Mailbox[LegacySample] = Mailbox(_SAMPLES_MAX)
        try:
            self._await_first(port)
        except BaseException:
            port.close()
            raise
        self._heard = clock()
        self._reader = Reader(
            port, self._on_bytes, lambda: None, self._box.fail, clock=clock, reconnect=reconnect
        )
        self._reader.start()

    @property
    def faults(self) -> dict[LegacyFault, int]:
        """Lines thrown away, by reason. The first, half line after opening is among them."""
        return dict(self._parser.faults)

    @property
    def refused(self) -> int:
        """Samples that found this program's buffer full."""
        return self._box.refused

    def take(self, within_s: float = IO_TIMEOUT_S) -> list[LegacySample]:
        """Samples since the last call; waits up to `within_s` [s, at most 1] for the first.

        Raises:
            InstrumentLost: unplugged, or silent for 1 s.
        """
        samples = self._box.take(min(within_s, IO_TIMEOUT_S))
        if not samples and not self._reader.away:
            self._check_silence()
        return samples

    def check(self) -> None:
        """Raise InstrumentLost when it is gone or silent; takes nothing, from any thread."""
        if self._box.failure is not None:
            raise self._box.failure
        self._check_silence()

    def _check_silence(self) -> None:
        if self._clock() - self._heard > SILENCE_MAX_S:
            raise InstrumentLost(f"{self._reader.device}: no line for a second. Is the board on?")

    def close(self) -> None:
        """Close it; idempotent."""
        self._reader.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_bytes(self, data: bytes, receipt: float) -> None:
        for sample in self._parser.feed(data, receipt):
            self._heard = receipt
            self._box.put(sample)

    def _await_first(self, port: SerialPort) -> None:
        heard, start = b"", self._clock()
        while self._clock() - start < _OPENING_S:
            data = port.read()
            heard = (heard + data)[-1024:]
            samples = self._parser.feed(data, self._clock())
            for sample in samples:
                self._box.put(sample)
            if samples:
                return
        device, baud = port.address.device, port.address.baud
        if not heard:
            raise InstrumentTimeout(
                f"{device} is silent for {_OPENING_S:g} s: is this the tachometer, is it on?"
            )
        if text_share(heard) < 0.8:
            raise WrongBaudRate(
                f"{device} sends bytes that are no text at {baud} baud; the sketch uses {BAUD}"
            )
        raise WrongDevice(f"{device} sends {heard[-40:]!r}, not 'millis, omega' lines")


def as_arrays(samples: list[LegacySample]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s] and speeds [rad/s] of samples, (n,) each."""
    times = np.array([sample.time for sample in samples], dtype=np.float64)
    return times, np.array([sample.omega for sample in samples], dtype=np.float64)
