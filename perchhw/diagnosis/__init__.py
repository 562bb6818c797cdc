"""Why a flight ended as it did, from its record alone (``docs/reports.md``)."""

from perchhw.diagnosis.diagnose import diagnose, diagnose_run, keep_diagnosis
from perchhw.diagnosis.finding import Cause, Diagnosis

__all__ = ["Cause", "Diagnosis", "diagnose", "diagnose_run", "keep_diagnosis"]
