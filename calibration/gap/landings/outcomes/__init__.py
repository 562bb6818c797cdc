"""How landings end: from the recorded trigger of each flight to the probabilities of four legs, two, none."""

from calibration.gap.landings.outcomes.dispersion import Dispersion
from calibration.gap.landings.outcomes.document import (
    LandingReport,
    landing_report,
    require_searchable,
    search_report,
)
from calibration.gap.landings.outcomes.labels import LABELS_FILE, lost_labels, read_labels
from calibration.gap.landings.outcomes.predict import Forecast, OutcomeForecast, forecast
from calibration.gap.landings.outcomes.prepare import PreparedLandings, prepare
from calibration.gap.landings.outcomes.scores import Score, score

__all__ = [
    "LABELS_FILE",
    "Dispersion",
    "Forecast",
    "LandingReport",
    "OutcomeForecast",
    "PreparedLandings",
    "Score",
    "forecast",
    "landing_report",
    "lost_labels",
    "prepare",
    "read_labels",
    "require_searchable",
    "score",
    "search_report",
]
