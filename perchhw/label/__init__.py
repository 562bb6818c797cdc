"""The landing outcome of a flight, from what its data show (``docs/labels.md``)."""

from perchhw.label.geometry import LabelError, LandingGeometry, landing_geometry
from perchhw.label.landing_label import LandingLabel, label_flight, label_from_truth

__all__ = [
    "LabelError",
    "LandingGeometry",
    "LandingLabel",
    "label_flight",
    "label_from_truth",
    "landing_geometry",
]
