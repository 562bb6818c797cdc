"""What motion capture did before a moment, from the verdicts in the record."""

from collections import Counter
from dataclasses import replace
from itertools import groupby

import numpy as np

from mocap_bridge.health import HealthLimits
from onboard.record.run_record import RunRecord
from perchhw.diagnosis.finding import Cause, Diagnosis

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
_TAKEN = HealthLimits().relock_samples - 1
"""Poses of another place refused in a row, after which the next is believed while the drone stands."""
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


def blame_poses(run: RunRecord, found: Diagnosis) -> Diagnosis:
    """What was found, as the consequence of poses that jumped before take-off, where the record shows that.

    A pose that stays elsewhere is believed on the ground, for somebody may have moved the drone; from there
    on the drone's estimate is wrong.
    """
    counts = _taken_on_the_ground(run)
    if not counts:
        return found
    frames = ", ".join(f"{count} frames {name}" for name, count in counts.items())
    return replace(
        found,
        cause=Cause.MOCAP_JUMPED,
        sentence=f"{WORDS[Cause.MOCAP_JUMPED]}, before take-off ({frames}); {found.sentence}",
        next=f"{REMEDIES[Cause.MOCAP_JUMPED]}; then {found.next}",
        values={**found.values, **counts},
    )


def _taken_on_the_ground(run: RunRecord) -> dict[str, int]:
    """Poses refused as jumped or flipped before take-off, by verdict; nothing where fewer came in a row than
    make the other place believed."""
    pose = run.series.get("pose")
    if pose is None:
        return {}
    phases = [e for e in run.events if e["event"] == "phase"]
    off = next((e["t"] for e in phases if e.get("phase") == "taking off"), np.inf)
    verdicts = pose.texts("verdict")
    before = [(verdicts[k] or "").lower() for k in np.flatnonzero(pose.t < off)]
    rows = [list(row) for refused, row in groupby(before, key=_jumps) if refused]
    if max(map(len, rows), default=0) < _TAKEN:
        return {}
    return dict(Counter(name for row in rows for name in row))


def _jumps(verdict: str) -> bool:
    return _CAUSES.get(verdict) is Cause.MOCAP_JUMPED


def frames_share(run: RunRecord) -> float | None:
    """Frames that came as a share of those that the source counted, or None."""
    pose = run.series.get("pose")
    if pose is None:
        return None
    frames = pose.numbers("frame")
    frames = frames[np.isfinite(frames)]
    span = float(frames[-1] - frames[0]) if frames.size > 1 else 0.0
    return (frames.size - 1) / span if span > 0.0 else None
