"""Put a calibration into a vehicle file, as a change that can be read before and undone after."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calibration.bench.procedures.calibration import Calibration, ResultFileError
from calibration.errors import CalibrationError
from calibration.measurement import Estimate
from onboard.errors import InputError
from onboard.quantity import Quantity
from onboard.thrust_map import ThrustMapForm
from onboard.vehicle import (
    Effect,
    ThrustMapDescription,
    Vehicle,
    VehicleFileError,
    load_vehicle,
    vehicle_to_toml,
)

HISTORY_SUFFIX = ".history"


class NothingToUndo(CalibrationError, InputError):
    """A vehicle file without an applied calibration."""


def changed_vehicle(vehicle: Vehicle, calibrations: Sequence[Calibration]) -> Vehicle:
    """A vehicle with the numbers of calibrations in place of its own; each names its calibration as source.

    Args:
        vehicle: as it is.
        calibrations: in their order.

    Raises:
        ResultFileError: a calibration names a quantity that vehicle files lack, or claims no uncertainty
            of one.
    """
    for calibration in calibrations:
        vehicle = _apply_one(vehicle, calibration)
    return vehicle


def _apply_one(vehicle: Vehicle, calibration: Calibration) -> Vehicle:
    source = f"{calibration.kind} calibration {calibration.id}, {calibration.made[:10]}"
    change = calibration.change
    unknown = [key for key, estimate in change.estimates.items() if not math.isfinite(estimate.u95)]
    if unknown:
        raise ResultFileError(
            f"calibration {calibration.id}: nobody knows the uncertainty of {', '.join(unknown)}, and a "
            "vehicle file says one of every number: measure again with more trials (4 or more of a swing)"
        )
    for key, estimate in change.quantities.items():
        section_name, _, name = key.partition(".")
        section: Any = getattr(vehicle, section_name, None)
        if not hasattr(section, name):
            raise ResultFileError(f"calibration {calibration.id}: vehicle files have no {key!r}")
        section = dataclasses.replace(section, **{name: estimate.quantity(source)})
        replaced: dict[str, Any] = {section_name: section}
        vehicle = dataclasses.replace(vehicle, **replaced)
    if change.thrust_map is not None:
        form, coefficients = change.thrust_map
        thrust_map = ThrustMapDescription(
            form=ThrustMapForm[form.upper()], coefficients=_quantities(coefficients, source)
        )
        vehicle = dataclasses.replace(
            vehicle, motors=dataclasses.replace(vehicle.motors, thrust_map=thrust_map)
        )
    return vehicle.with_effects(
        Effect(name=name, parameters=_quantities(parameters, source))
        for name, parameters in change.effects.items()
    )


def _quantities(estimates: Mapping[str, Estimate], source: str) -> dict[str, Quantity]:
    return {key: estimate.quantity(source) for key, estimate in estimates.items()}


def write_applied(vehicle: Vehicle, file: Path) -> Path | None:
    """Write a vehicle file; what it held before goes into ``FILE.history/``.

    Returns:
        Where the old file is kept, or None when there was none.

    Raises:
        VehicleFileError: what was written cannot be read back; the old file is in place again.
    """
    kept = None
    history = file.with_name(file.name + HISTORY_SUFFIX)
    if file.is_file():
        history.mkdir(exist_ok=True)
        kept = history / f"{1 + len(list(history.glob('*.toml'))):03d}.toml"
        kept.write_bytes(file.read_bytes())
    draft = file.with_name(f".{file.name}.draft")
    draft.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    try:
        load_vehicle(draft)
    except VehicleFileError:
        draft.unlink()
        raise
    draft.replace(file)
    return kept


def undo(file: Path) -> Path:
    """Put the file back that the last applied calibration replaced; gives the name it had in the history.

    Raises:
        NothingToUndo: no history.
    """
    history = file.with_name(file.name + HISTORY_SUFFIX)
    kept = sorted(history.glob("*.toml"))
    if not kept:
        raise NothingToUndo(f"{file}: no calibration was applied to it (no {history.name}/)")
    last = kept[-1]
    last.replace(file)
    return last
