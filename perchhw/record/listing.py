"""Find and summarise run folders."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.record.run_record import (
    RUN_FILE,
    SERIES_FILE,
    RunFolderError,
    is_run_folder,
    read_info,
    series_finished,
)
from onboard.record.series_file import has_end


@dataclass(frozen=True)
class RunSummary:
    """One run in a list; what ``run.json`` does not say is None.

    Attributes:
        folder: the run folder.
        started_utc: wall time of the start (ISO 8601).
        speed: commanded speed (m/s).
        angle_deg: commanded angle (deg).
        outcome: landing outcome; ``dry_run_passed`` where nothing was to fly, ``flown`` for a test flight.
        triggered: whether the policy fired.
        aborted_by: rule that ended the run early.
        closed: whether the writer finished the record.
        cut_off: whether the end of the series of a closed record is missing: a damaged copy.
    """

    folder: Path
    started_utc: str | None
    speed: float | None
    angle_deg: float | None
    outcome: str | None
    triggered: bool | None
    aborted_by: str | None
    closed: bool
    cut_off: bool


def summarise_run(folder: Path) -> RunSummary:
    """Summarise one run from its ``run.json``, and from the last bytes of its series.

    Raises:
        RunFolderError: no run folder, or one that cannot be read.
    """
    if not is_run_folder(folder):
        raise RunFolderError(f"{folder} is not a run folder: it needs run.json and series.mcap")
    try:
        info = read_info(folder)
        cut_off = series_finished(info) and not has_end(folder / SERIES_FILE)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be read ({error.strerror})") from error
    config = info["config"]
    outcome, aborted_by = info.get("outcome"), info.get("aborted_by")
    if outcome == "aborted" and aborted_by is None and config.get("dry_run"):
        outcome = "dry_run_passed"  # records of before this outcome had its name
    return RunSummary(
        folder=folder,
        started_utc=info.get("started_utc"),
        speed=config.get("speed_m_s"),
        angle_deg=config.get("angle_deg"),
        outcome=outcome,
        triggered=info.get("triggered"),
        aborted_by=aborted_by,
        closed=bool(info["closed"]),
        cut_off=cut_off,
    )


def find_runs(root: Path) -> tuple[list[RunSummary], list[str]]:
    """All runs below `root` as they were flown (those that do not say when come first), and in words those
    whose ``run.json`` is broken.

    Raises:
        RunFolderError: `root` does not exist.
    """
    if not root.is_dir():
        raise RunFolderError(f"{root}: no such folder; give the folder that holds the runs")
    runs, broken = [], []
    for path in sorted(root.rglob(RUN_FILE)):
        if not is_run_folder(path.parent):
            continue
        try:
            runs.append(summarise_run(path.parent))
        except RunFolderError as error:
            broken.append(str(error))
    runs.sort(key=lambda run: run.started_utc or "")
    return runs, broken


def kept_diagnosis(folder: Path | None) -> dict[str, Any] | None:
    """What the record `folder` says of what happened and why; None where it is not explained or broken."""
    try:
        kept = None if folder is None or not (folder / RUN_FILE).is_file() else read_info(folder)
    except RunFolderError:
        return None
    diagnosis = None if kept is None else kept.get("diagnosis")
    return diagnosis if isinstance(diagnosis, dict) and "sentence" in diagnosis else None


def kept_sentence(folder: Path | None) -> str | None:
    """Its sentence."""
    kept = kept_diagnosis(folder)
    return None if kept is None else str(kept["sentence"])
