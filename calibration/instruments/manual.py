"""A person as an instrument: reads a kitchen scale or a multimeter and types the number."""

import math
from collections.abc import Callable

from calibration.instruments.errors import InstrumentInputError
from calibration.instruments.scale import MassReading
from calibration.instruments.supply import SupplyReading
from onboard.clock import Clock, monotonic

Ask = Callable[[str, str], float]
"""``ask(quantity, unit)`` asks the person and gives the number in that unit, however it was typed."""


class ManualScale:
    """A scale read by a person; a :class:`~calibration.instruments.scale.Scale`."""

    def __init__(self, ask: Ask, *, clock: Clock = monotonic) -> None:
        self._ask = ask
        self._clock = clock
        self._zero = 0.0

    def tare(self, seconds: float = 0.0) -> None:
        """Ask for the reading of the scale as it is; later readings count from it (`seconds` is not used)."""
        self._zero = _number(self._ask, "reading of the scale without load", "kg")

    def average(self, seconds: float = 0.0) -> MassReading:
        """One typed reading [kg]; one number has no scatter, the caller knows the resolution of the scale.

        Raises:
            InstrumentInputError: what was typed is no finite number.
        """
        start = self._clock()
        mass = _number(self._ask, "reading of the scale", "kg") - self._zero
        return MassReading(mass, 0.0, 1, start, self._clock(), ())

    def close(self) -> None:
        """Nothing to close."""


class ManualSupply:
    """A supply (or a battery) set and read by a person."""

    def __init__(self, ask: Ask, tell: Callable[[str], None], *, clock: Clock = monotonic) -> None:
        """`tell` shows the person one sentence and returns when it is done."""
        self._ask = ask
        self._tell = tell
        self._clock = clock
        self._on = False

    def set(self, voltage: float, current_limit: float) -> None:
        """Have the person set voltage [V] and current limit [A]."""
        self._tell(f"Set the supply to {voltage:.2f} V with a current limit of {current_limit:.1f} A.")

    def switch(self, on: bool) -> None:
        """Have the person switch it."""
        self._tell(f"Switch the supply {'on' if on else 'off'}.")
        self._on = on

    def measure(self) -> SupplyReading:
        """Voltage typed by the person [V]; the current is not known (NaN), nor whether it is limited."""
        voltage = _number(self._ask, "voltage at the drone (multimeter)", "V")
        return SupplyReading(voltage, math.nan, False, self._clock())

    def close(self) -> None:
        """Have the person switch it off, if it is on."""
        if self._on:
            self.switch(on=False)

    def __enter__(self) -> "ManualSupply":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _number(ask: Ask, quantity: str, unit: str) -> float:
    value = ask(quantity, unit)
    if not math.isfinite(value):
        raise InstrumentInputError(f"{quantity}: {value} is no number in {unit}; read it again")
    return value
