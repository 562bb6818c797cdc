"""What ``perchhw gap landings`` says: predicted and real outcomes, flight by flight, and their score."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.data.record import NotUsed
from calibration.gap.landings.outcomes.dispersion import Dispersion
from calibration.gap.landings.outcomes.labels import CLASS_NAMES, landing_class
from calibration.gap.landings.outcomes.predict import OutcomeForecast
from calibration.gap.landings.outcomes.prepare import Prepared
from calibration.gap.landings.outcomes.scores import Score, score
from onboard.outcome import Outcome

SCHEMA = "perchhw.gap_landings/1"

LEAST_FLIGHTS = 4
"""Fewer classified flights have no score."""


@dataclass(frozen=True)
class LandingReport:
    """Predictions beside what happened.

    Attributes:
        vehicle: name. seed: of the draws.
        prepared: the flights. forecast: what the vehicle expects of them, in the same order.
        real: outcome of each, None where nobody classified it.
        score: of the classified ones; None when there are fewer than LEAST_FLIGHTS.
        unused: flights that are not judged.
    """

    vehicle: str
    seed: int
    prepared: Prepared
    forecast: OutcomeForecast
    real: tuple[Outcome | None, ...]
    score: Score | None
    unused: tuple[NotUsed, ...]

    @property
    def dispersion(self) -> Dispersion:
        """How the starts scatter."""
        return self.prepared.dispersion

    def to_json(self) -> dict[str, Any]:
        """The document ``perchhw.gap_landings/1``."""
        return {
            "schema": SCHEMA,
            "vehicle": self.vehicle,
            "seed": self.seed,
            "draws": self.forecast.draws,
            "flights": [self._flight(index) for index in range(len(self.real))],
            "score": None if self.score is None else self.score.to_json(),
            "dispersion": self.dispersion.to_json(),
            "flip": {
                "pitch_rate_rms_rad_s": _rms(self.prepared.rate_error),
                "pitch_slope": _mean(self.prepared.slopes.pitch),
                "roll_per_pitch": _mean(self.prepared.slopes.roll),
            },
            "unusable": [{"file": item.name, "reason": item.reason} for item in self.unused],
        }

    def _flight(self, index: int) -> dict[str, Any]:
        flight, real = self.forecast.flights[index], self.real[index]
        shares = {f"p_{name}": float(p) for name, p in zip(CLASS_NAMES, flight.probability, strict=True)}
        return {
            "name": flight.name,
            "real": None if real is None else real.value,
            **shares,
            "p_body_contact": flight.body_contact,
            "ceiling_m": float(self.prepared.ceilings[index]),
            "contact_s": flight.contact,
            "contact_measured_s": flight.measured_contact,
        }


def landing_report(
    prepared: Prepared, found: OutcomeForecast, real: Sequence[Outcome | None], vehicle: str, seed: int,
    unreadable: Sequence[NotUsed] = (),
) -> LandingReport:  # fmt: skip
    """Score a forecast.

    Args:
        prepared: the flights. found: what the model expects of them.
        real: outcomes in the order of the starts.
        vehicle: its name. seed: of the draws; the bootstrap has a stream of its own.
        unreadable: files that hold no flight.
    """
    classes = [None if outcome is None else landing_class(outcome) for outcome in real]
    rows = [index for index, one in enumerate(classes) if one is not None]
    scored = None
    if len(rows) >= LEAST_FLIGHTS:
        known = np.array([one for one in classes if one is not None], dtype=np.int64)
        rng = np.random.default_rng([seed, 1])
        scored = score(found.probability[rows], known, found.draws, rng)
    return LandingReport(vehicle, seed, prepared, found, tuple(real), scored, (*unreadable, *prepared.unused))


def _rms(values: Any) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else None


def _mean(values: Any) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else None
