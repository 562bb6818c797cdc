"""The load cell: raw counts and their faults.

The HX711 amplifier gives signed 24-bit counts at 10 or 80 per second (a jumper), shows its two extreme codes
when the input is out of range, and needs 10 to 15 min to warm up (note bench.md, section 4).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.bench.instruments.errors import ScaleUnusable
from calibration.bench.instruments.line_device import LineInstrument, LinkReport
from calibration.bench.instruments.protocol import RAW_MAX, RAW_MIN, Kind, LoadLine
from calibration.bench.instruments.scale import ScaleReading
from calibration.bench.instruments.transport import IO_TIMEOUT_S
from calibration.measurement import Finding, Severity, rejected

#: The two conversion rates of the amplifier [1/s], and how far its own oscillator may be off.
RATES, RATE_TOLERANCE = (10.0, 80.0), 0.15
#: A live amplifier never repeats one code so often.
STUCK_AFTER = 8
#: Codes within this of the ends of the range are saturated [counts].
_EDGE = 16
#: The data line is held by a powered-down amplifier, which reads as all ones or all zeros.
_DEAD_CODES = (0, -1)


@dataclass(frozen=True, slots=True)
class LoadBatch:
    """Conversions since the last look.

    Attributes:
        epoch: counts restarts of the device.
        times: (n,), on the device's clock [s].
        raw: (n,), counts.
        receipts: (n,), host clock [s].
        lost_lines: lines missing within.
    """

    epoch: int
    times: NDArray[np.float64]
    raw: NDArray[np.int64]
    receipts: NDArray[np.float64]
    lost_lines: int


def check_counts(times: NDArray[np.float64], raw: NDArray[np.int64]) -> tuple[Finding, ...]:
    """What is wrong with conversions at `times` [s] (n,) with `raw` counts (n,)."""
    if raw.size == 0:
        return (
            Finding(
                "no_counts",
                Severity.REJECT,
                "the load cell gave no reading: is the amplifier wired, does it have power?",
            ),
        )
    findings = []
    dead = np.isin(raw, _DEAD_CODES)
    extreme = (raw <= RAW_MIN + _EDGE) | (raw >= RAW_MAX - _EDGE)
    if extreme.any():
        text = f"{int(extreme.sum())} of {raw.size} readings are saturated: overload, or a broken wire"
        findings.append(Finding("saturated", Severity.REJECT, text))
    if raw.size >= STUCK_AFTER and dead.all():
        text = "the amplifier is powered down or not connected: it only gives 0 or -1"
        findings.append(Finding("powered_down", Severity.REJECT, text))
    elif raw.size >= STUCK_AFTER and not extreme.all() and np.unique(raw).size == 1:
        text = (
            f"the reading is stuck at {int(raw[0])} counts for {raw.size} conversions; a live one has noise"
        )
        findings.append(Finding("stuck", Severity.REJECT, text))
    if raw.size >= STUCK_AFTER:
        rate = (raw.size - 1) / max(float(times[-1] - times[0]), 1e-6)
        if not any(abs(rate / nominal - 1.0) < RATE_TOLERANCE for nominal in RATES):
            text = f"{rate:.1f} readings/s instead of 10 or 80: lines are lost, or the device is another one"
            findings.append(Finding("scale_rate", Severity.WARNING, text))
    return tuple(findings)


class LoadCell(LineInstrument):
    """An open load cell; a context manager and a :class:`~calibration.bench.instruments.scale.Scale`."""

    kind = Kind.LOAD_CELL
    unit, least_span, typed = "counts", 100.0, False

    def _opened(self) -> None:
        self._seen: list[LoadBatch] = []
        self._restarts = 0
        self._device.start()

    @property
    def report(self) -> LinkReport:
        """What the link has lost."""
        return self._device.report

    def take(self, within_s: float = IO_TIMEOUT_S) -> LoadBatch:
        """Conversions since the last call; waits up to `within_s` [s, at most 1] for a line.

        After a restart of the device the times begin anew (and `epoch` is another).

        Raises:
            InstrumentLost: unplugged for good, or no line for 1 s.
        """
        placed = self._device.take(within_s)
        loads = [(one, one.line) for one in placed if isinstance(one.line, LoadLine)]
        return LoadBatch(
            placed[-1].epoch if placed else 0,
            np.array([1e-6 * one.ticks for one, _ in loads], dtype=np.float64),
            np.array([line.raw for _, line in loads], dtype=np.int64),
            np.array([one.receipt for one, _ in loads], dtype=np.float64),
            sum(one.lost for one in placed),
        )

    def begin(self) -> None:
        """Forget what came: a reading begins now."""
        self._device.take(0.0)
        self._seen = []
        self._restarts = self._device.report.restarts

    def look(self, within_s: float) -> None:
        """Take in conversions; errors as for :meth:`take`."""
        self._seen.append(self.take(within_s))

    def read(self) -> ScaleReading:
        """Mean counts since the beginning.

        Raises:
            ScaleUnusable: no conversions, or stuck, saturated or powered down; or the board restarted.
        """
        report = self._device.report
        if report.restarts > self._restarts:
            raise ScaleUnusable(
                f"{self.device} restarted during the reading: check cable and supply, read again"
            )
        times = np.concatenate([batch.times for batch in self._seen] or [np.empty(0)])
        raw = np.concatenate([batch.raw for batch in self._seen] or [np.empty(0, dtype=np.int64)])
        findings = check_counts(times, raw)
        if rejected(findings):
            said = "".join(f". The board says: {event.text}" for event in report.events[-1:])
            raise ScaleUnusable(f"load cell {self.device}: {findings[0].text}{said}")
        return ScaleReading(float(raw.mean()), findings)
