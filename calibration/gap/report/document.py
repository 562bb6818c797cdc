"""The gap finder's report as data, and as the JSON that other programs read (``perchhw.gap/1``).

Every name of the JSON is an attribute here. What the contract does not name (limitations, ambiguous sets,
what was rejected, settings) stands beside it.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from calibration.errors import CalibrationError
from calibration.gap.data.found_effect import FoundEffect, Verdict
from calibration.gap.data.record import NotUsed
from calibration.gap.landings import LandingFindings
from onboard.json_file import as_json

SCHEMA = "perchhw.gap/1"

METRIC = "position, attitude given"
"""The quantity whose error stands for the whole gap."""


@dataclass(frozen=True, kw_only=True)
class Levels:
    """A number of the model before and after, and what no model could beat; None where that is not known."""

    before: float
    after: float
    noise_floor: float | None = None
    unit: str = ""

    @property
    def closed_share(self) -> float | None:
        """Share of what could be removed that was; None without a floor, or with nothing to remove."""
        if self.noise_floor is None or not self.before > self.noise_floor:
            return None
        return (self.before - self.after) / (self.before - self.noise_floor)


@dataclass(frozen=True, kw_only=True)
class Gap:
    """The gap on flights that no fit saw.

    Attributes:
        metric: what `overall` is, in words, such as "position error after 1 s, attitude given".
        overall: its levels; the unit is that of the metric.
        predictions: levels of each predicted quantity, by its name in words ("velocity, attitude given") and
            by horizon (s); those of the metric's own quantity (:data:`METRIC`) among them.
        by_channel: levels by channel ("force_z").
        by_phase: levels of the metric by phase of flight ("near_ceiling").
    """

    metric: str
    overall: Levels
    predictions: Mapping[str, Mapping[float, Levels]] = field(default_factory=dict)
    by_channel: Mapping[str, Levels] = field(default_factory=dict)
    by_phase: Mapping[str, Levels] = field(default_factory=dict)

    @property
    def by_horizon(self) -> dict[float, Levels]:
        """Levels of the metric's own quantity by horizon (s)."""
        return dict(self.predictions.get(METRIC, {}))

    @property
    def by_quantity(self) -> dict[str, Levels]:
        """Levels of all other quantities, by name ("velocity after 0.5 s, attitude given")."""
        return {
            f"{name} after {horizon:g} s, {way}": levels
            for quantity, by_horizon in self.predictions.items()
            if quantity != METRIC
            for name, _, way in [quantity.partition(", ")]
            for horizon, levels in by_horizon.items()
        }

    def json_shape(self) -> dict[str, Any]:
        """As in the contract; the share of the removable gap that was closed stands beside it."""
        return {
            "metric": self.metric,
            **vars(self.overall),
            "closed_share": self.overall.closed_share,
            "by_horizon": self.by_horizon,
            "by_channel": self.by_channel,
            "by_phase": self.by_phase,
            "by_quantity": self.by_quantity,
        }


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where the gap lived before anything was added: `share` of it in this channel under this condition."""

    channel: str
    condition: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Unexplained:
    """What is left after all effects.

    Attributes:
        share: of the gap before that is left and structured.
        suspects: what it goes with: regressors, frequencies, or effects that come close and do not explain.
    """

    share: float
    channels: tuple[str, ...] = ()
    suspects: tuple[str, ...] = ()
    formula: str | None = None


@dataclass(frozen=True, kw_only=True)
class Rejected:
    """An effect, or a term without a name, and in words the rule of acceptance that it failed."""

    name: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class UnnamedTerms:
    """What was found, has no name, and whether the improved vehicle has it all the same.

    Attributes:
        written: in words, those that are in the vehicle file as ``[[unnamed]]``.
        closes: the gap's metric with names alone, and with what is written besides; None: nothing is.
    """

    written: tuple[str, ...] = ()
    refused: tuple[Rejected, ...] = ()
    closes: Levels | None = None


@dataclass(frozen=True, kw_only=True)
class AmbiguousSet:
    """Effects that these flights cannot tell apart, best first, and what would."""

    names: tuple[str, ...]
    separated_by: str


@dataclass(frozen=True, kw_only=True)
class GapReport:
    """What ``perchhw gap find`` found.

    Attributes:
        vehicle: name of the model that was held against the flights.
        where: where the gap lived, largest share first.
        train, held_out: names of the flights that were fitted and of those that no fit saw.
        ambiguous: sets of effects that the data cannot tell apart, whether or not one of them was found.
        rejected: effects that were near but not accepted.
        limitations: what cannot be concluded from these flights, in sentences.
        nameless: what is said of terms without a name, under the key that it has in the file.
        landings: what they were judged by; None without flips, or for a vehicle without legs.
        seed: of every random number.
        settings: anything else that a repetition needs (versions, options), by name.
        noise: measured noise of the channels, by name; numbers, texts, lists or tables of them.
    """

    verdict: Verdict
    vehicle: str
    effects: tuple[FoundEffect, ...]
    gap: Gap
    where: tuple[Where, ...]
    unexplained: Unexplained
    train: tuple[str, ...]
    held_out: tuple[str, ...]
    unusable: tuple[NotUsed, ...] = ()
    ambiguous: tuple[AmbiguousSet, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    limitations: tuple[str, ...] = ()
    nameless: UnnamedTerms = UnnamedTerms()
    landings: LandingFindings | None = None
    seed: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    noise: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that verdict and effects agree."""
        if bool(self.effects) and self.verdict is Verdict.NO_GAP:
            raise CalibrationError("a report without a gap cannot have effects")
        if not self.effects and self.verdict is Verdict.EFFECTS_FOUND:
            raise CalibrationError("a report with the verdict effects_found needs an effect")

    def json_shape(self) -> dict[str, Any]:
        """The document.

        Raises:
            CalibrationError: a number that is not finite; names its place.
        """
        document: dict[str, Any] = {"schema": SCHEMA}
        document |= {one.name: as_json(getattr(self, one.name)) for one in fields(self)}
        document["flights"] = {name: document.pop(name) for name in ("train", "held_out", "unusable")}
        for place, number in leaves(document):
            if isinstance(number, float) and not math.isfinite(number):
                raise CalibrationError(f"report: {place} is {number}; a missing number must be null")
        return document

    def text(self) -> str:
        """The document as text."""
        return json.dumps(as_json(self), indent=1, allow_nan=False) + "\n"


def leaves(value: Any, place: str = "") -> list[tuple[str, Any]]:
    """Everything in a document that is neither table nor list, with its place such as ``gap.by_phase``."""
    if isinstance(value, Mapping):
        return [leaf for key, item in value.items() for leaf in leaves(item, f"{place}.{key}".lstrip("."))]
    if isinstance(value, list | tuple):
        return [leaf for index, item in enumerate(value) for leaf in leaves(item, f"{place}[{index}]")]
    return [(place, value)]
