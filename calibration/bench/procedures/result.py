"""The result of a calibration as a file: numbers with uncertainty, budget, inputs, raw data, provenance.

``result.json`` (schema ``perchhw.calibration/1``) is named by its content: `id` is the start of the SHA-256
of everything else. A run that is fitted anew writes a new result and names the one before as its parent.
"""

import hashlib
import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from calibration.errors import CalibrationError
from calibration.measurement import Contribution, DrawnEstimate, Estimate, Finding, Severity
from onboard.errors import InputError
from onboard.json_file import write_json_atomically

SCHEMA = "perchhw.calibration/1"
RESULT_FILE = "result.json"
ID_LENGTH = 12


class ResultFileError(CalibrationError, InputError):
    """A result file that cannot be used."""


@dataclass(frozen=True, kw_only=True)
class VehicleChange:
    """What a calibration changes in a vehicle file.

    Attributes:
        quantities: estimates by key ("body.inertia_xx", "motors.time_constant_up").
        thrust_map: form and coefficients, or None when the map stays.
        effects: parameters by effect name.
    """

    quantities: Mapping[str, Estimate] = field(default_factory=dict)
    thrust_map: tuple[str, Mapping[str, Estimate]] | None = None
    effects: Mapping[str, Mapping[str, Estimate]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Everything that a run says.

    Attributes:
        kind: "bifilar", "tachometer" or "thrust".
        change: what it changes in a vehicle file.
        budgets: contributions to the uncertainty, by the key of the quantity.
        findings: what the checks have seen.
        details: of the method: models, alternatives, domain, derived values; JSON.
        inputs: what was measured by hand; name to estimate.
        provenance: drone, operator, instruments, place; JSON.
        raw: recordings as ``{file, sha256}``.
        made: UTC, ISO 8601.
    """

    kind: str
    change: VehicleChange
    budgets: Mapping[str, Sequence[Contribution]]
    findings: Sequence[Finding]
    details: Mapping[str, Any]
    inputs: Mapping[str, Estimate]
    provenance: Mapping[str, Any]
    raw: Sequence[Mapping[str, str]]
    made: str


def estimate_to_json(estimate: Estimate) -> dict[str, Any]:
    """An estimate with all that is needed to read it back."""
    dof = estimate.dof if estimate.dof < 1e9 else None
    return {**estimate.to_json(), "sigma": estimate.sigma, "dof": dof}


def estimate_from_json(raw: Mapping[str, Any]) -> Estimate:
    """The estimate that :func:`estimate_to_json` wrote, with the interval that it had."""
    dof = math.inf if raw["dof"] is None else float(raw["dof"])
    half = math.inf if raw["u95"] is None else float(raw["u95"])
    return DrawnEstimate(float(raw["value"]), str(raw["unit"]), float(raw["sigma"]), dof, half)


def _all_to_json(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    return {key: estimate_to_json(one) for key, one in estimates.items()}


def _change_to_json(change: VehicleChange) -> dict[str, Any]:
    thrust_map = None
    if change.thrust_map is not None:
        form, coefficients = change.thrust_map
        thrust_map = {"form": form, "coefficients": _all_to_json(coefficients)}
    return {
        "quantities": _all_to_json(change.quantities),
        "thrust_map": thrust_map,
        "effects": {name: _all_to_json(parameters) for name, parameters in change.effects.items()},
    }


def to_document(calibration: Calibration, parent: str | None) -> dict[str, Any]:
    """The result as JSON, with its id."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": calibration.kind,
        "made": calibration.made,
        "vehicle": _change_to_json(calibration.change),
        "budgets": {
            key: [{"name": one.name, "share": one.share, "advice": one.advice} for one in lines]
            for key, lines in calibration.budgets.items()
        },
        "findings": [finding.to_json() for finding in calibration.findings],
        "details": dict(calibration.details),
        "inputs": _all_to_json(calibration.inputs),
        "provenance": {
            **calibration.provenance,
            "software": f"perchhw {version('perchhw')}",
            "python": platform.python_version(),
        },
        "raw": [dict(one) for one in calibration.raw],
        "parent": parent,
    }
    text = json.dumps(document, sort_keys=True, allow_nan=False)
    return {"id": hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH], **document}


def write_result(calibration: Calibration, folder: Path) -> dict[str, Any]:
    """Write ``result.json`` of a run; an earlier one is kept as ``result-ID.json``, named as the parent."""
    path = folder / RESULT_FILE
    parent = None
    if path.is_file():
        parent = str(load_result(path)["id"])
        path.replace(folder / f"result-{parent}.json")
    document = to_document(calibration, parent)
    write_json_atomically(path, document)
    return document


def load_result(path: Path) -> dict[str, Any]:
    """Read a result: the file, or the folder of a run.

    Raises:
        ResultFileError: not there, not a result, or changed since it was written.
    """
    file = path / RESULT_FILE if path.is_dir() else path
    try:
        document: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultFileError(f"{file}: cannot be read ({error.strerror}); give a run's folder") from error
    except ValueError as error:
        raise ResultFileError(f"{file}: is not JSON ({error})") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ResultFileError(f"{file}: is not the result of a calibration (schema {SCHEMA})")
    content = {key: value for key, value in document.items() if key != "id"}
    text = json.dumps(content, sort_keys=True, allow_nan=False)
    if hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH] != document.get("id"):
        raise ResultFileError(f"{file}: was changed after it was written; fit the run again")
    return document


def was_rejected(document: Mapping[str, Any]) -> list[str]:
    """What the checks rejected, in words."""
    return [one["text"] for one in document["findings"] if one["severity"] == Severity.REJECT.value]
