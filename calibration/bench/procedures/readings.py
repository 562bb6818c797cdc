"""Readings of the same thing: what a person types, and the estimate that comes of them."""

import re
from collections.abc import Sequence

from calibration.bench.inertia.rig import measured
from calibration.bench.procedures.operator import AnswerNotUsable, Question
from calibration.measurement import Estimate
from onboard.quantity import convert, si_unit

_READING = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z%][A-Za-z0-9 /%]*)?\s*$")
_LENGTHS_AND_MASSES = ("mm", "cm", "m", "g", "kg", "V", "mV")


def parse_reading(text: str, question: Question) -> float:
    """``"60.1 mm"`` in the unit of the question; a bare number counts as SI.

    A value that is not plausible is never repaired by guessing: the message asks what was meant.

    Raises:
        AnswerNotUsable: not a number, a unit that measures something else, or an implausible value.
        UnitError: an unknown unit.
    """
    match = _READING.match(text)
    if match is None:
        raise AnswerNotUsable(
            f"{question.name}: {text!r} is not a measurement; write it like '60.1 {question.shown_unit}'"
        )
    number = float(match.group(1))
    value = convert(number, (match.group(2) or question.unit).strip(), question.unit)
    low, high = question.plausible
    if low <= value <= high:
        return value
    raise AnswerNotUsable(_asked_again(text.strip(), number, question))


def _asked_again(text: str, number: float, question: Question) -> str:
    low, high = (convert(limit, question.unit, question.shown_unit) for limit in question.plausible)
    message = f"{question.name}: {text!r} is outside {low:g} to {high:g} {question.shown_unit}"
    meant = [
        unit
        for unit in _LENGTHS_AND_MASSES
        if si_unit(unit)[0] == si_unit(question.unit)[0]
        and question.plausible[0] <= convert(number, unit, question.unit) <= question.plausible[1]
    ]
    if meant:
        return f"{message}; did you mean {' or '.join(f'{number:g} {unit}' for unit in meant)}? Say the unit"
    return f"{message}; measure again, and say the unit"


def estimate_of(readings: Sequence[float], question: Question) -> Estimate:
    """The mean of the readings of a question."""
    return measured(readings, question.half_width, question.unit)
