"""What a folder of ``perchhw learn`` holds, read back for reports: sweep, policy, validation."""

import csv
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from onboard.json_file import parsed
from onboard.policy.files import Policy, load_policy, policy_crc32
from perchhw.learning.bands import best_per_condition
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition
from perchhw.learning.sweep_folder import (
    MEASURED_FILE,
    PAIRS_FILE,
    POLICY_FILE,
    SWEEP_FILE,
    TRAINING_FILE,
    VALIDATION_FILE,
    VALIDATION_SUMMARY,
    Row,
    read_pairs,
    read_settings,
)

_REFERENCE_COLUMNS = (("speed_m_s", "angle_deg", "landing_rate"), ("Vel_d", "Phi_d", "LR_4Leg"))
_FASTEST = 10.0  # m/s
_ANGLES_DEG = (5.0, 90.0)


@dataclass(frozen=True)
class RateMap:
    """Landing rates of one method over the approach conditions.

    Attributes:
        name: for titles.
        rates: 0..1 by condition; the best of the repeats where there are several.
        trigger_rates: share of the attempts that triggered, where it is known.
    """

    name: str
    rates: Mapping[Condition, float]
    trigger_rates: Mapping[Condition, float] | None = None


@dataclass(frozen=True)
class LearningResults:
    """A folder of ``perchhw learn``; what was not done yet is None.

    Attributes:
        folder: where it is.
        sweep: ``sweep.json``; without pairs the settings of the validation.
        pairs: rows of ``pairs.csv``; none where a policy came from elsewhere (``learn surface``).
        policy, training: the trained policy and ``training.json``.
        validation: rows of ``validation.csv``. validation_summary: ``validation.json``.
        measured: rows of ``validation_measured.csv``: the policy as real approaches scatter.
        doubts: in words, where the parts do not belong together.
    """

    folder: Path
    sweep: dict[str, Any]
    pairs: tuple[Row, ...]
    policy: Policy | None
    training: dict[str, Any] | None
    validation: tuple[Row, ...] | None
    validation_summary: dict[str, Any] | None
    doubts: tuple[str, ...]
    measured: tuple[Row, ...] | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the sweep, or of the validation where there is none."""
        settings: dict[str, Any] = self.sweep["settings"]
        return settings

    def pair_rates(self) -> RateMap | None:
        """Best rate of the pairs at each condition; None without pairs."""
        return RateMap("sensory-motor pairs", best_per_condition(self.pairs)) if self.pairs else None

    @property
    def measured_alone(self) -> bool:
        """Whether the validation was asked for in the measured world, and so has no other."""
        return self.measured is not None and self.validation == self.measured

    def policy_rates(self) -> RateMap | None:
        """Rate of the two-stage policy at each condition, in the world that was asked for; None where that is
        the measured one."""
        if self.measured_alone:
            return None
        settings = (self.validation_summary or {}).get("settings", {})
        name = f"policy, {cues_in_words(settings)}" if settings.get("sensing") else "policy"
        return _rates_of(self.validation, name)

    def measured_rates(self) -> RateMap | None:
        """Likewise as real approaches scatter."""
        return _rates_of(self.measured, "policy, measured dispersion")


def cues_in_words(settings: Mapping[str, Any]) -> str:
    """The errors of cues and approach of a validation's settings, for headings."""
    cues = f"{settings['sensing']} cues"
    return f"{cues} and the launch of --launch" if settings.get("launch") else cues


def _rates_of(rows: tuple[Row, ...] | None, name: str) -> RateMap | None:
    if rows is None:
        return None
    return RateMap(name, best_per_condition(rows), best_per_condition(rows, "trigger_rate"))


def columns(rows: tuple[Row, ...], *names: str) -> tuple[FloatArray, ...]:
    """Columns of rows, each (n,) float64; rows with an empty cell in any of them are left out."""
    full = [[float(cell) for name in names if (cell := row[name]) is not None] for row in rows]
    numbers = np.array([row for row in full if len(row) == len(names)], np.float64)
    return tuple(numbers.reshape(-1, len(names)).T)


def read_results(folder: Path) -> LearningResults:
    """Read a folder of ``perchhw learn``: a sweep with policy and validation where they are there, or a
    validation without a sweep, as of ``learn surface``.

    Raises:
        LearningInputError: it holds neither, an empty sweep, or a file that cannot be read.
        PolicyFileError: the policy cannot be read.
    """
    summary = _read_json(folder / VALIDATION_SUMMARY)
    sweep, pairs = _read_sweep(folder, summary)
    policy = load_policy(folder / POLICY_FILE) if (folder / POLICY_FILE).is_file() else None
    validation = None
    if (folder / VALIDATION_FILE).is_file():
        validation = _read_table(folder / VALIDATION_FILE)
    measured = _read_table(folder / MEASURED_FILE) if (folder / MEASURED_FILE).is_file() else None
    return LearningResults(
        folder=folder,
        sweep=sweep,
        pairs=pairs,
        policy=policy,
        training=_read_json(folder / TRAINING_FILE),
        validation=validation,
        validation_summary=summary,
        doubts=_doubts(folder, sweep, len(pairs), policy, summary),
        measured=measured,
    )


def _read_sweep(folder: Path, summary: dict[str, Any] | None) -> tuple[dict[str, Any], tuple[Row, ...]]:
    """``sweep.json`` and pairs; without both the settings of the validation, and no pairs."""
    if not (folder / PAIRS_FILE).is_file():
        validated = summary is not None and (folder / VALIDATION_FILE).is_file()
        if summary is None or not validated or (folder / SWEEP_FILE).exists():
            raise LearningInputError(
                f"{folder}: has no {PAIRS_FILE}: give a folder of perchhw learn sweep, or of another "
                "policy once learn validate has flown it"
            )
        if not isinstance(summary.get("settings"), dict):
            raise LearningInputError(f"{folder / VALIDATION_SUMMARY}: has no settings: validate again")
        return {"settings": summary["settings"]}, ()
    sweep = read_settings(folder / SWEEP_FILE)
    if not isinstance(sweep.get("settings"), dict):
        raise LearningInputError(f"{folder / SWEEP_FILE}: has no settings: restore it, or sweep again")
    pairs = tuple(read_pairs(folder / PAIRS_FILE, cut_tail=True).values())
    if not pairs:
        raise LearningInputError(
            f"{folder / PAIRS_FILE}: has no trial yet: finish it with perchhw learn sweep --resume"
        )
    return sweep, pairs


def read_reference(path: Path) -> RateMap:
    """Landing rates to compare with: any table with speed, angle and rate, ours or the authors' (``Vel_d``,
    ``Phi_d``, ``LR_4Leg``); the best of a condition's rows counts.

    Rows with an approach that nobody can command (the authors' tables have a few misprints) are left out.

    Raises:
        LearningInputError: naming file, line and column.
    """
    rows, names = _read_table(path), _reference_columns(path)
    table = np.column_stack(columns(rows, *names))
    speed, angle, _ = table.T
    flyable = (speed > 0.0) & (speed <= _FASTEST) & (angle >= _ANGLES_DEG[0]) & (angle <= _ANGLES_DEG[1])
    usable = table[flyable]
    wrong = usable[(usable[:, 2] < 0.0) | (usable[:, 2] > 1.0), 2]
    if len(wrong) or not len(usable):
        found = f"a rate of {wrong[0]:g}" if len(wrong) else "no row with speed, angle and rate"
        raise LearningInputError(f"{path}: column {names[2]} has {found}: give rates from 0 to 1")
    named: list[Row] = [dict(zip(_REFERENCE_COLUMNS[0], row, strict=True)) for row in usable.tolist()]
    return RateMap(f"reference: {path.stem}", best_per_condition(named))


def _reference_columns(path: Path) -> tuple[str, str, str]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = next(csv.reader(file), [])
    for names in _REFERENCE_COLUMNS:
        if set(names) <= set(header):
            repeated = [name for name in names if header.count(name) > 1]
            if repeated:
                raise LearningInputError(
                    f"{path}: line 1: column given twice: {', '.join(repeated)}; leave the one that counts"
                )
            return names
    wanted = " or ".join(", ".join(names) for names in _REFERENCE_COLUMNS)
    raise LearningInputError(f"{path}: line 1: the columns {wanted} are missing")


def _read_table(path: Path) -> tuple[Row, ...]:
    """Rows of a CSV; cells that are no numbers are None."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return tuple(
                {k: _number(v) for k, v in row.items() if k is not None} for row in csv.DictReader(file)
            )
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LearningInputError(f"{path}: cannot be read as a table ({error}): check the path") from error


def _number(cell: str | None) -> float | None:
    try:
        value = float(cell or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _read_json(path: Path) -> dict[str, Any] | None:
    if not path.is_file():
        return None
    try:
        document = parsed(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise LearningInputError(f"{path}: is not JSON ({error}): make it again") from error
    if not isinstance(document, dict):
        raise LearningInputError(f"{path}: is not a JSON object: make it again")
    return document


def _doubts(
    folder: Path,
    sweep: dict[str, Any],
    trials: int,
    policy: Policy | None,
    summary: dict[str, Any] | None,
) -> tuple[str, ...]:
    """Where sweep, policy and validation do not belong together."""
    doubts = []
    if not trials:
        doubts.append("no pairs are here: their sections, and those of learning trials, are left out")
    expected = _expected_trials(sweep["settings"])
    if expected is not None and trials < expected:
        doubts.append(f"the sweep is not finished: {trials} of {expected} trials")
    if policy is not None:
        trained_on = policy.provenance.get("pairs", {}).get("sha256")
        if trials and trained_on != hashlib.sha256((folder / PAIRS_FILE).read_bytes()).hexdigest():
            doubts.append("the policy was trained on another table of pairs than this one")
        if summary is not None and summary.get("policy_crc32") != policy_crc32(policy):
            doubts.append("the validation flew another policy than this one")
    return tuple(doubts)


def _expected_trials(settings: dict[str, Any]) -> int | None:
    speeds, angles, repeats = (settings.get(name) for name in ("speeds", "angles_deg", "repeats"))
    if isinstance(speeds, list) and isinstance(angles, list) and isinstance(repeats, int):
        return len(speeds) * len(angles) * repeats
    return None
