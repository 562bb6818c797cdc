"""The range that a number of a file must lie in, and why it ends there."""

import math
from dataclasses import dataclass

from onboard.quantity import Quantity, convert
from onboard.unit_slip import unit_hint


@dataclass(frozen=True)
class Bounds:
    """A closed range.

    Attributes:
        unit: SI unit of the number, or ``deg`` where its key ends in it.
        least, most: ends of the range, both allowed.
        why_least, why_most: why it ends there; an empty `why_most`: for the same reason.
        sigma: largest standard uncertainty (k = 1) that the number may have.
    """

    unit: str
    least: float
    most: float
    why_least: str
    why_most: str = ""
    sigma: float = math.inf

    def contains(self, value: float) -> bool:
        """Whether `value` lies in the range; nothing that is not a number does."""
        return self.least <= value <= self.most

    @property
    def text(self) -> str:
        """The range in words; angles in deg, because that is how people say them."""
        return f"{number_text(self.least, self.unit)} to {number_text(self.most, self.unit, with_unit=True)}"

    def problem(self, value: float, written: Quantity) -> str | None:
        """What is wrong with `value`, which somebody has `written` so, or ``None``."""
        if not math.isfinite(value):
            return f"is {written.value:g} {written.unit}; give a number from {self.text}"
        if not self.contains(value):
            given, hint = f"is {written.value:g} {written.unit}", self._hint(written)
            if value < self.least or not self.why_most:
                return f"{given}; it must be {self.text}: {self.why_least}{hint}"
            return f"{given}; it must be {self.text}: {self.why_most}{hint}"
        sigma = convert(written.sigma, written.unit, self.unit)
        if sigma > self.sigma:
            return (
                f"has a sigma of {written.sigma:g} {written.unit}; it must be known to {self.sigma:g} "
                f"{self.unit} or better: measure it again"
            )
        return None

    def _hint(self, written: Quantity) -> str:
        """What to write instead of a number that was meant in another unit."""
        value = written.value
        if written.unit == self.unit and self.unit != "rad":
            return unit_hint(value, self.unit, self.contains)
        as_degrees = convert(value, "deg", "rad")
        if written.unit != "rad" or not (abs(value) > math.pi or self.contains(as_degrees)):
            return ""
        table = f'{{ value = {value:g}, unit = "deg", sigma = 0, source = "..." }}'
        return f". That looks like degrees; write radians ({as_degrees:.4g}), or {table}"


def number_text(value: float, unit: str, *, with_unit: bool = False) -> str:
    """A number as the documents show it; rad are shown as deg."""
    if unit == "rad":
        value, unit = math.degrees(value), "deg"
    return f"{value:.6g} {unit}" if with_unit else f"{value:.6g}"
