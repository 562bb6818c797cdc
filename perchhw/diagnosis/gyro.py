"""A gyro that turned while the drone stood still, behind whatever became of its flight."""

from dataclasses import replace

import numpy as np

from onboard.record.run_record import RunRecord
from perchhw.diagnosis.finding import Cause, Diagnosis

BIAS_RAD_S = 0.03
"""Mean rate of a drone that stands still; a calibrated gyro is below 0.01."""
_REMEDY = "reboot the drone where it stands still, and let it warm up first"


def blame_gyro(run: RunRecord, found: Diagnosis) -> Diagnosis:
    """What was found, as the consequence of a biased gyro where the record shows one."""
    bias = _bias(run)
    if bias is None or bias <= BIAS_RAD_S:
        return found
    return replace(
        found,
        cause=Cause.GYRO_BIASED,
        sentence=f"the gyro read {bias:.2f} rad/s while the drone stood still; {found.sentence}",
        next=_REMEDY,
        values={**found.values, "gyro_bias_rad_s": bias},
    )


def _bias(run: RunRecord) -> float | None:
    """Mean rate (rad/s) that the gyro reported before the motors were armed, or None."""
    phases = [e for e in run.events if e["event"] == "phase"]
    armed = next((e["t"] for e in phases if e.get("phase") in ("arming", "done")), None)
    rates = run.series.get("rates")
    if rates is None or armed is None or not (still := rates.t < armed).any():
        return None
    means = [float(np.nanmean(rates.numbers(name)[still])) for name in ("gx", "gy", "gz")]
    return float(np.linalg.norm(means))
