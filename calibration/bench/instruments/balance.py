"""A laboratory balance that speaks MT-SICS (Mettler-Toledo's interface command set, which many others copy).

``SI`` asks for the mass now: ``S S <mass> <unit>`` stable, ``S D ...`` moving, ``S +`` overload, ``S -``
underload, ``S I`` busy; ``ES``, ``ET``, ``EL`` are errors.
"""

import math

from calibration.bench.instruments.conversation import Conversation
from calibration.bench.instruments.errors import InstrumentRefused, ScaleUnusable, WrongDevice
from calibration.bench.instruments.scale import ScaleReading
from calibration.measurement import Finding, Severity
from onboard.clock import Clock, monotonic
from onboard.closing import Closing

BAUD = 9_600
#: Mass of one unit [kg].
_UNITS = {"g": 1e-3, "kg": 1.0, "mg": 1e-6}
_REFUSALS = {
    "S +": "overload: take weight off",
    "S -": "underload: is the pan on it?",
    "S I": "it is busy or not yet warm",
    "ES": "it does not know the command",
    "ET": "the command was damaged on its way",
    "EL": "it refuses the command now",
}


class Balance(Closing):
    """An open balance; a context manager and a :class:`~calibration.bench.instruments.scale.Scale`."""

    unit, least_span, typed = "kg", 5e-3, False

    def __init__(self, address: str, *, clock: Clock = monotonic) -> None:
        """Open it and ask for one reading.

        Raises:
            InstrumentInputError, InstrumentNotFound, InstrumentTimeout, WrongBaudRate, WrongDevice.
        """
        self._seen: list[tuple[float, bool]] = []
        self._conversation = Conversation(address, BAUD, clock=clock)
        try:
            answer = self._conversation.ask_line(b"SI\r\n")
            if not answer.startswith(("S ", "E")):
                raise WrongDevice(f"{self.device} is no balance: it answers {answer[:40]!r} to 'SI'")
        except BaseException:
            self._conversation.close()
            raise

    @property
    def device(self) -> str:
        """Name of its port."""
        return self._conversation.device

    def read_mass(self) -> tuple[float, bool]:
        """The mass now [kg], and whether it is stable.

        Raises:
            InstrumentRefused: overload, underload, busy, or an answer that is none.
            InstrumentTimeout, InstrumentLost.
        """
        return self._mass(self._conversation.ask_line(b"SI\r\n"))

    def begin(self) -> None:
        """Forget what it showed."""
        self._seen = []

    def look(self, within_s: float) -> None:
        """Ask once, whatever `within_s`; errors as for :meth:`read_mass`."""
        self._seen.append(self.read_mass())

    def read(self) -> ScaleReading:
        """Mean mass [kg] since the beginning.

        Raises:
            ScaleUnusable: it was never asked.
        """
        if not self._seen:
            raise ScaleUnusable(f"balance {self.device}: it was not read once")
        masses = [mass for mass, _ in self._seen]
        findings: tuple[Finding, ...] = ()
        if not any(stable for _, stable in self._seen):
            text = "the balance was never stable during a reading: draught, or the load still moves"
            findings = (Finding("unstable", Severity.WARNING, text),)
        return ScaleReading(sum(masses) / len(masses), findings)

    def check(self) -> None:
        """It speaks only when asked: that it is gone is seen then."""

    def close(self) -> None:
        """Close it; idempotent."""
        self._conversation.close()

    def _mass(self, answer: str) -> tuple[float, bool]:
        fields = answer.split()
        if len(fields) == 4 and fields[0] == "S" and fields[1] in ("S", "D"):
            mass = _number(fields[2])
            if mass is not None and fields[3] in _UNITS:
                return mass * _UNITS[fields[3]], fields[1] == "S"
        reason = _REFUSALS.get(" ".join(fields[:2]), f"it answers {answer!r}")
        raise InstrumentRefused(f"{self.device} gives no mass: {reason}")


def _number(text: str) -> float | None:
    """A plain decimal number, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in text else None
