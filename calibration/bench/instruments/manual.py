"""A person as an instrument: sets what has no port, reads it, and types the number."""

import math
from typing import Protocol

from calibration.bench.instruments.errors import InstrumentInputError
from calibration.bench.instruments.scale import ScaleReading
from calibration.bench.instruments.supply import SupplyReading
from onboard.clock import Clock, monotonic
from onboard.closing import Closing

DEVICE = "by hand"
BY_EYE_S = 4.0
"""For a person to read a scale [s]."""


class Person(Protocol):
    """Whoever works instruments that have no port."""

    def look_at_scale(self, seconds: float) -> None:
        """Read the scale within `seconds` [s] from now; do not wait."""

    def weight(self) -> float:
        """What was read then [kg]."""

    def voltage(self) -> float:
        """What the supply shows [V]."""

    def set_supply(self, voltage: float, current_limit: float) -> None:
        """Set the supply to `voltage` [V] and `current_limit` [A]."""

    def switch_supply(self, on: bool) -> None:
        """Switch its output."""


class ManualScale(Closing):
    """A scale read by a person; a :class:`~calibration.bench.instruments.scale.Scale`."""

    unit, least_span, typed, device = "kg", 5e-3, True, DEVICE

    def __init__(self, person: Person) -> None:
        self._person = person

    def begin(self) -> None:
        """Have the person look, for :data:`BY_EYE_S`."""
        self._person.look_at_scale(BY_EYE_S)

    def look(self, within_s: float) -> None:
        """The person looks."""

    def read(self) -> ScaleReading:
        """The one reading that the person types [kg].

        Raises:
            InstrumentInputError: what was typed is no finite number.
        """
        return ScaleReading(_finite(self._person.weight(), "reading of the scale", "kg"))

    def check(self) -> None:
        """A person does not get lost."""

    def close(self) -> None:
        """Nothing to close."""


class ManualSupply(Closing):
    """A :class:`~calibration.bench.instruments.supply.Supply` set and read by a person, and by nobody else:
    it cannot be cut when the program dies."""

    typed, device = True, DEVICE

    def __init__(self, person: Person, *, clock: Clock = monotonic) -> None:
        self._person = person
        self._clock = clock
        self._voltage = math.nan
        self._on = False

    def set(self, voltage: float, current_limit: float) -> None:
        """Have the person set voltage [V] and current limit [A]; if it is on, they read what it shows.

        Raises:
            InstrumentInputError: what was typed is no finite number.
        """
        self._person.set_supply(voltage, current_limit)
        self._read()

    def switch(self, on: bool) -> None:
        """Have the person switch it; errors as for :meth:`set`."""
        if on is not self._on:
            self._on = True  # also while it is being switched off
            self._person.switch_supply(on)
            self._on = on
            self._read()

    def measure(self) -> SupplyReading:
        """The voltage as the person read it when it was set [V]; nobody knows the current (NaN), nor whether
        it is limited."""
        return SupplyReading(self._voltage, math.nan, False, self._clock())

    def close(self) -> None:
        """Have the person switch it off, if it is on."""
        if self._on:
            self.switch(on=False)

    def _read(self) -> None:
        if self._on:
            self._voltage = _finite(self._person.voltage(), "voltage of the supply", "V")


def _finite(value: float, quantity: str, unit: str) -> float:
    if not math.isfinite(value):
        raise InstrumentInputError(f"{quantity}: {value} is no number in {unit}; read it again")
    return value
