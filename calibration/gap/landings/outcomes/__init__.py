"""How landings end: from the recorded trigger of each flight to the probabilities of four legs, two, none."""

from calibration.gap.landings.outcomes.document import (
    LandingReport,
    landing_report,
    require_searchable,
    search_report,
)
from calibration.gap.landings.outcomes.labels import LABELS_FILE, lost_labels, read_labels
from calibration.gap.landings.outcomes.predict import forecast
from calibration.gap.landings.outcomes.prepare import PreparedLandings, prepare

__all__ = [
    "LABELS_FILE",
    "LandingReport",
    "PreparedLandings",
    "forecast",
    "landing_report",
    "lost_labels",
    "prepare",
    "read_labels",
    "require_searchable",
    "search_report",
]
