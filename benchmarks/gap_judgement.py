"""How a report of the gap finder is held against what was hidden."""

from collections.abc import Sequence
from typing import Any

import numpy as np

REMOVABLE = 0.1
"""Excess of squared residuals, in units of what remains with the true effects, below which nothing is
removable."""
SMALL = 0.2
"""Parameters smaller than this share of an effect's largest are left out of relative errors."""


def judge(report: dict[str, Any], sealed: dict[str, Any]) -> dict[str, Any]:
    """A report against the sealed answer."""
    truth = {effect["name"]: effect for effect in sealed["effects"]}
    named = {effect["name"]: effect for effect in report["effects"]}
    first = next(iter(report["effects"]), None)
    same = {effect["name"]: _same(effect, truth) for effect in report["effects"]}
    pairs = [pair for name in named if name in truth for pair in _values(named[name], truth[name])]
    return {
        "truth": list(truth),
        "named": list(named),
        "first": first["name"] if first else None,
        "ambiguous": {name: effect["ambiguous_with"] for name, effect in named.items()},
        "verdict": report["verdict"],
        "expected_verdict": sealed["verdict"],
        "first_right": bool(first) and same[first["name"]],
        "all_found": all(
            name in named or any(name in effect["ambiguous_with"] for effect in named.values())
            for name in truth
        ),
        "false_names": [name for name, right in same.items() if not right],
        "values": pairs,
        "unexplained": report["unexplained"],
        "unlisted": sealed.get("unlisted"),
    }


def _same(effect: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a name is the truth, or says that it may be."""
    return effect["name"] in truth or any(name in truth for name in effect["ambiguous_with"])


def _values(found: dict[str, Any], hidden: dict[str, Any]) -> list[dict[str, Any]]:
    from onboard.vehicle import EFFECTS

    if found["name"] == "ceiling_effect":
        return [_ceiling_gain(found, hidden)]
    rules = EFFECTS[found["name"]].parameters
    hidden = {**hidden, "parameters": {k: v for k, v in hidden["parameters"].items() if k != "time_constant"}}
    size = {k: abs(v - (rules[k].neutral or 0.0)) for k, v in hidden["parameters"].items()}
    pairs = []
    for key, value in hidden["parameters"].items():
        if key in found["parameters"] and size[key] >= SMALL * max(size.values()) and size[key] > 0.0:
            one = found["parameters"][key]
            covered = one["ci95"][0] <= value <= one["ci95"][1]
            error = abs(one["value"] - value) / size[key]
            pairs.append({"parameter": key, "error": round(error, 4), "covered": covered})
    return pairs


def _ceiling_gain(found: dict[str, Any], hidden: dict[str, Any]) -> dict[str, Any]:
    """Its two parameters trade off: what counts is the gain of thrust, here 50 mm below the ceiling."""
    from sim_backend.physics.effects.ceiling_effect import EFFECT, ceiling_gain
    from sim_backend.physics.parameters import PARAMETERS

    gains = []
    values = {key: one["value"] for key, one in found["parameters"].items()}
    for parameters in ({"inflow": 0.0, "opening": 1.0, **values}, hidden["parameters"]):
        p = np.zeros(1, dtype=PARAMETERS)[0]
        p["propeller_radius"] = 0.0225
        EFFECT.apply(p, parameters)
        gains.append(ceiling_gain(p, 0.05, 1.0) - 1.0)
    error = round(abs(gains[0] / gains[1] - 1.0), 4)
    return {"parameter": "gain at 50 mm", "error": error, "covered": None}


def closed_share(
    records: Sequence[Any],
    held_out: list[str],
    found: Any,
    vehicle: Any,
    sealed: dict[str, Any],
    ceiling: float | None = None,
) -> float | None:
    """Share of the removable gap that the found model closes, on flights that no fit saw.

    What the true effects take away from the squared residuals of the vehicle file (means of 0.1 s, each
    channel in units of what remains with the true effects) is removable. None where sensors are at fault,
    where the truth has no name, and where there was nothing to remove.
    """
    from calibration.gap.data.signals import VOLTAGE
    from calibration.gap.estimate.held_out import HeldOutFlights
    from calibration.gap.estimate.model import Model, Variable
    from calibration.gap.sensors import apply_sensing, judge_sensing
    from onboard.vehicle import EFFECTS
    from onboard.vehicle.effects import Domain

    hidden = sealed["effects"]
    if any(record.voltage is None for record in records):
        return None  # what stands for it is the finder's own, and differs from model to model
    if sealed["unlisted"] or not hidden or any(EFFECTS[e["name"]].domain is Domain.SENSING for e in hidden):
        return None
    values = {Variable(e["name"], k): x for e in hidden for k, x in e["parameters"].items()}
    corrected = apply_sensing(records, judge_sensing(records))
    flights = HeldOutFlights([record for record in corrected if record.name in held_out])
    models = (Model(vehicle), Model(found.vehicle, {}, found.ceiling_z), Model(vehicle, values, ceiling))
    before, after, least = (flights.errors(model).rms() ** 2 for model in models)
    known = least > 0.0
    known[VOLTAGE] &= any(effect["name"] == "battery_sag" for effect in hidden)  # else the load's own error
    removable = float(np.sum((before[known] - least[known]) / least[known]))
    if removable < REMOVABLE:
        return None
    return 1.0 - float(np.sum((after[known] - least[known]) / least[known])) / removable
