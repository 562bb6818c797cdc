"""What motion capture did before a moment, from the verdicts in the record."""

from collections import Counter

import numpy as np

from onboard.record.run_record import RunRecord
from perchhw.diagnosis.finding import Cause

_WINDOW_S = 0.6
"""Longer than the time without poses after which an attempt is ended."""
_OLD_S = 0.025
"""Age of a pose at its receipt; in a sound room it is 9 ms."""
_CAUSES = {
    "occluded": Cause.MOCAP_OCCLUDED,
    "frozen": Cause.MOCAP_FROZEN,
    "jumped": Cause.MOCAP_JUMPED,
    "flipped": Cause.MOCAP_JUMPED,
    "late": Cause.MOCAP_LATE,
}
WORDS = {
    Cause.MOCAP_OCCLUDED: "motion capture did not see the drone",
    Cause.MOCAP_FROZEN: "motion capture repeated one pose (frozen)",
    Cause.MOCAP_JUMPED: "the pose jumped or turned round, as after a marker swap",
    Cause.MOCAP_LATE: "the poses came too late",
    Cause.MOCAP_SILENT: "frames of motion capture stayed away",
}
REMEDIES = {
    Cause.MOCAP_OCCLUDED: "look at markers and cameras where it was lost (perchhw mocap watch URI)",
    Cause.MOCAP_FROZEN: "restart the tracking of this subject and watch it (perchhw mocap watch URI)",
    Cause.MOCAP_JUMPED: "make the marker pattern asymmetric, calibrate anew, then perchhw mocap watch URI",
    Cause.MOCAP_LATE: "look at the network between the cameras and this computer (perchhw mocap watch URI)",
    Cause.MOCAP_SILENT: "look at the cameras' server and the network, then perchhw mocap watch URI",
}


def mocap_fault(run: RunRecord, t: float) -> tuple[Cause, dict[str, int]]:
    """What was wrong with the poses up to `t` (s), and how many samples were refused for what."""
    pose = run.series.get("pose")
    if pose is None:
        return Cause.MOCAP_SILENT, {}
    near = (pose.t > t - _WINDOW_S) & (pose.t <= t)
    verdicts = pose.texts("verdict")
    counts = Counter((verdicts[k] or "").lower() for k in np.flatnonzero(near))
    refused = {name: count for name, count in counts.items() if name in _CAUSES}
    if refused:
        return _CAUSES[max(refused, key=lambda name: refused[name])], refused
    age = (pose.t - pose.numbers("capture_time"))[near]
    if np.isfinite(age).any() and np.nanmedian(age) > _OLD_S:
        return Cause.MOCAP_LATE, {"age_ms": round(1e3 * float(np.nanmedian(age)))}
    return Cause.MOCAP_SILENT, {"frames": int(near.sum())}


def frames_share(run: RunRecord) -> float | None:
    """Frames that came as a share of those that the source counted, or None."""
    pose = run.series.get("pose")
    if pose is None:
        return None
    frames = pose.numbers("frame")
    frames = frames[np.isfinite(frames)]
    span = float(frames[-1] - frames[0]) if frames.size > 1 else 0.0
    return (frames.size - 1) / span if span > 0.0 else None
