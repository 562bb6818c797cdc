"""A calibration and its file: numbers with uncertainty, budget, inputs, raw data, provenance.

``result.json`` (schema ``perchhw.calibration/1``) is named by its content: `id` is the start of the SHA-256
of everything else. A run that is fitted anew writes a new result and names the one before as its parent.
"""

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from calibration.errors import CalibrationError
from calibration.measurement import Contribution, Estimate, Finding, Severity
from onboard.errors import InputError
from onboard.json_file import as_json, parsed, write_json_atomically
from onboard.schema import schema_problem

SCHEMA = "perchhw.calibration/1"
RESULT_FILE = "result.json"
ID_LENGTH = 12

Estimates = Mapping[str, Estimate]


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

    quantities: Estimates = field(default_factory=dict)
    thrust_map: tuple[str, Estimates] | None = None
    effects: Mapping[str, Estimates] = field(default_factory=dict)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """What :meth:`json_shape` wrote."""
        thrust_map = document["thrust_map"]
        return cls(
            quantities=_estimates(document["quantities"]),
            thrust_map=thrust_map and (str(thrust_map["form"]), _estimates(thrust_map["coefficients"])),
            effects={name: _estimates(parameters) for name, parameters in document["effects"].items()},
        )

    def json_shape(self) -> dict[str, Any]:
        """``{quantities, thrust_map, effects}``, estimates with all that is needed to read them back."""
        form, coefficients = self.thrust_map or (None, {})
        return {
            "quantities": _documents(self.quantities),
            "thrust_map": form and {"form": form, "coefficients": _documents(coefficients)},
            "effects": {name: _documents(parameters) for name, parameters in self.effects.items()},
        }

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Quantities and parameters of effects by key ("body.mass", "effects.motor_speed_law.a_up")."""
        parameters = {
            f"effects.{name}.{key}": estimate
            for name, effect in self.effects.items()
            for key, estimate in effect.items()
        }
        return {**self.quantities, **parameters}


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Everything that a run says.

    Attributes:
        kind: "bifilar", "tachometer", "thrust" or "capture".
        change: what it changes in a vehicle file.
        budgets: contributions to the uncertainty, by the key of the quantity.
        findings: what the checks have seen.
        details: of the method: models, alternatives, domain, derived values; JSON.
        inputs: what was measured by hand; name to estimate.
        provenance: drone, operator, instruments, place; JSON.
        raw: recordings as ``{file, sha256}``.
        made: UTC, ISO 8601.
        curve: thrust (N) by motor voltage (V); empty where none was measured.
        parent: id of the fit before, if this one replaces it.
    """

    kind: str
    change: VehicleChange
    budgets: Mapping[str, Sequence[Contribution]]
    findings: Sequence[Finding]
    details: Mapping[str, Any]
    inputs: Estimates
    provenance: Mapping[str, Any]
    raw: Sequence[Mapping[str, str]]
    made: str
    curve: Mapping[float, Estimate] = field(default_factory=dict)
    parent: str | None = None

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """The calibration that :meth:`document` described.

        Raises:
            KeyError, TypeError, ValueError: something is missing or of another kind.
        """
        details = dict(document["details"])
        curve = details.pop("curve", [])
        return cls(
            kind=str(document["kind"]),
            change=VehicleChange.from_document(document["vehicle"]),
            budgets={
                key: [
                    Contribution(name=one["name"], share=one["share"], advice=one["advice"]) for one in lines
                ]
                for key, lines in document["budgets"].items()
            },
            findings=[
                Finding(one["code"], Severity(one["severity"]), one["text"]) for one in document["findings"]
            ],
            details=details,
            inputs=_estimates(document["inputs"]),
            provenance=document["provenance"],
            raw=document["raw"],
            made=str(document["made"]),
            curve={row["voltage_v"]: Estimate.from_document(row["thrust"]) for row in curve},
            parent=document["parent"],
        )

    @property
    def id(self) -> str:
        """Of its content."""
        return _id_of(self._content())

    def document(self) -> dict[str, Any]:
        """As JSON, with its id."""
        content = self._content()
        return {"id": _id_of(content), **content}

    def _content(self) -> dict[str, Any]:
        curve = [{"voltage_v": volts, "thrust": thrust.document()} for volts, thrust in self.curve.items()]
        return {
            "schema": SCHEMA,
            "kind": self.kind,
            "made": self.made,
            "vehicle": self.change.json_shape(),
            "budgets": {
                key: [{"name": one.name, "share": one.share, "advice": one.advice} for one in lines]
                for key, lines in self.budgets.items()
            },
            "findings": as_json(self.findings),
            "details": {**self.details, **({"curve": curve} if curve else {})},
            "inputs": _documents(self.inputs),
            "provenance": dict(self.provenance),
            "raw": as_json(self.raw),
            "parent": self.parent,
        }

    @property
    def rejections(self) -> list[str]:
        """What the checks rejected, in words."""
        return [one.text for one in self.findings if one.severity is Severity.REJECT]


def _estimates(documents: Mapping[str, Mapping[str, Any]]) -> dict[str, Estimate]:
    return {key: Estimate.from_document(one) for key, one in documents.items()}


def _documents(estimates: Estimates) -> dict[str, Any]:
    return {key: one.document() for key, one in estimates.items()}


def _id_of(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH]


def write_calibration(calibration: Calibration, folder: Path) -> Calibration:
    """Write ``result.json`` of a run; an earlier one is kept as ``result-ID.json``, named as the parent.

    Returns:
        What was written: with its parent, and the versions of the software in its provenance.
    """
    path = folder / RESULT_FILE
    parent = None
    if path.is_file():
        parent = load_calibration(path).id
        path.replace(folder / f"result-{parent}.json")
    software = {"software": f"perchhw {version('perchhw')}", "python": platform.python_version()}
    written = replace(calibration, parent=parent, provenance={**calibration.provenance, **software})
    write_json_atomically(path, written.document())
    return written


def load_calibration(path: Path) -> Calibration:
    """Read a result: the file, or the folder of a run.

    Raises:
        ResultFileError: not there, not a result, or changed since it was written.
    """
    file = path / RESULT_FILE if path.is_dir() else path
    try:
        document: dict[str, Any] = parsed(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultFileError(f"{file}: cannot be read ({error.strerror}); give a run's folder") from error
    except ValueError as error:
        raise ResultFileError(f"{file}: is not JSON ({error})") from error
    if not isinstance(document, dict):
        raise ResultFileError(f"{file}: is not the result of a calibration (schema {SCHEMA})")
    problem = schema_problem(document.get("schema"), SCHEMA)
    if problem is not None:
        raise ResultFileError(f"{file}: schema {problem}; give a run's folder")
    try:
        calibration = Calibration.from_document(document)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResultFileError(f"{file}: is damaged ({error!r}); fit the run again") from error
    if calibration.document() != document:
        raise ResultFileError(f"{file}: was changed after it was written; fit the run again")
    return calibration
