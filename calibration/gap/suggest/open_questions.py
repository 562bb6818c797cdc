"""Which questions a gap report leaves open: read from ``report.json`` (``perchhw.gap/1``)."""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from calibration.errors import CalibrationError
from calibration.gap.suggest.hypothesis import Hypothesis
from onboard.errors import InputError
from onboard.json_file import parsed
from onboard.schema import schema_problem
from onboard.vehicle import EFFECTS, Vehicle

SCHEMA = "perchhw.gap/1"


class GapReportError(CalibrationError, InputError):
    """A file is not a report of the gap finder; the message names it and what is wrong."""


@dataclass(frozen=True)
class OpenQuestions:
    """What a report leaves open.

    Attributes:
        pairs: effects that the data could not tell apart; the one that was found, or the likelier, first.
    """

    found: tuple[Hypothesis, ...]
    pairs: tuple[tuple[str, str], ...]

    def values_of(self, effect: str) -> Hypothesis:
        """The effect as it was found, else as an ordinary vehicle may have it."""
        for hypothesis in self.found:
            if hypothesis.effect == effect:
                typical = Hypothesis.neutral(effect).values
                return Hypothesis(effect, {**typical, **hypothesis.values})
        return Hypothesis.typical(effect)

    def vehicle(self, base: Vehicle) -> Vehicle:
        """A vehicle with everything that was found."""
        for hypothesis in self.found:
            base = hypothesis.on(base)
        return base


def read_questions(path: Path) -> OpenQuestions:
    """The open questions of a report.

    Suspects that are no effects (regressors, frequencies) ask nothing that a flight of the library answers.

    Raises:
        GapReportError: not a report, or it names an effect that does not exist.
    """
    try:
        document = parsed(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise GapReportError(f"{path}: cannot be read ({error.strerror}); give a report.json") from error
    except ValueError as error:
        raise GapReportError(f"{path}: is not JSON ({error}); give a report.json of `gap find`") from error
    if not isinstance(document, dict):
        raise GapReportError(f"{path}: is not a report of `gap find` (schema {SCHEMA}); give its report.json")
    problem = schema_problem(document.get("schema"), SCHEMA)
    if problem is not None:
        raise GapReportError(f"{path}: schema {problem}; give a report.json of `gap find`")
    try:
        return _questions(document)
    except (KeyError, TypeError, AttributeError) as error:
        raise GapReportError(f"{path}: lacks what a report has ({error!r}); run `gap find` again") from error


def _questions(document: dict[str, Any]) -> OpenQuestions:
    found, pairs = [], []
    for effect in document["effects"]:
        name = effect["name"]
        values = {key: float(value["value"]) for key, value in effect["parameters"].items()}
        if name in EFFECTS:
            found.append(Hypothesis(name, values))
        pairs += [(name, other) for other in effect.get("ambiguous_with", ())]
    for names in (item["names"] for item in document.get("ambiguous", ())):
        pairs += [(names[0], other) for other in names[1:]]
    pairs += combinations([s for s in document["unexplained"]["suspects"] if s in EFFECTS], 2)
    known = [pair for pair in pairs if pair[0] in EFFECTS and pair[1] in EFFECTS and pair[0] != pair[1]]
    distinct: dict[frozenset[str], tuple[str, str]] = {}
    for pair in known:
        distinct.setdefault(frozenset(pair), pair)
    return OpenQuestions(tuple(found), tuple(distinct.values()))
