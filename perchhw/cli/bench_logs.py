"""``--from-log``: the fits of the bench alone, on data that were recorded before."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from onboard.json_file import as_json
from perchhw.cli.output import emit

if TYPE_CHECKING:
    from calibration.bench.inertia.inertia import InertiaResult
    from calibration.bench.inertia.swing_fit import SwingFit
    from calibration.bench.motors.propellers import PropellerMap
    from calibration.bench.motors.tachometer_result import TachometerResult
    from onboard.vehicle import Vehicle


def fit_swings(files: Sequence[Path], typed: Mapping[str, str | None], tools: str, estimator: str) -> None:
    """Inertia about one axis from recorded swings.

    Args:
        files: recordings.
        typed: axis, mass, string-length and string-distance as typed; the last three may be missing together.
        tools: what measured them.
        estimator: ``paper`` puts the authors' peak estimate beside each period.

    Raises:
        AnswerNotUsable: an option is missing or cannot be used. SwingFileError, RigError.
        CopiedRecordingError: a recording is given twice.
    """
    from calibration.bench.copies import refuse_copies
    from calibration.bench.inertia.fit import fit_swing
    from calibration.bench.inertia.inertia import inertia_about_axis, mean_period
    from calibration.bench.inertia.paper import peak_period
    from calibration.bench.inertia.recordings import read_swing
    from calibration.bench.procedures.inertia import AXES
    from calibration.bench.procedures.operator import AnswerNotUsable

    axis = typed["axis"]
    if axis is None or axis not in AXES:
        raise AnswerNotUsable(f"--axis {axis}: say which body axis hung vertical: x, y or z")
    if estimator not in ("pendulum", "paper"):
        raise AnswerNotUsable(f"--estimator {estimator}: choose pendulum or paper")
    swings = [read_swing(file, AXES[axis]) for file in files]
    refuse_copies(zip(files, ((swing.time, swing.gyro) for swing in swings), strict=True))
    fits = [_as_recorded(fit_swing(swing)) for swing in swings]
    rig = _rig(typed, tools)
    result = None if rig is None else inertia_about_axis(fits, rig)
    counted = [fit.period.value for fit in fits if not fit.rejected]
    period = (
        mean_period(counted or [fit.period.value for fit in fits])[0] if result is None else result.period
    )
    findings = [one for fit in fits for one in fit.findings] + (
        [] if result is None else list(result.findings)
    )
    document: dict[str, Any] = {
        "inertia": None if result is None else result.inertia,
        "period_s": period,
        "trials": [_trial(fit) for fit in fits],
        "warnings": [finding.text for finding in findings],
        "budget": [] if result is None else [{"name": one.name, "share": one.share} for one in result.budget],
    }
    if estimator == "paper":
        for row, swing in zip(document["trials"], swings, strict=True):
            row["paper_period_s"] = peak_period(swing)
    emit(document, _swing_words(document, fits, result))


def _as_recorded(fit: "SwingFit") -> "SwingFit":
    """A recording of long ago cannot be made longer: few cycles are a warning there, no more."""
    from calibration.measurement import Severity

    milder = [
        replace(one, severity=Severity.WARNING) if one.code == "few_cycles" else one for one in fit.findings
    ]
    return replace(fit, findings=tuple(milder))


def _rig(typed: Mapping[str, str | None], tools: str) -> Any:
    from calibration.bench.inertia.rig import Rig
    from calibration.bench.procedures.inertia import TOOLS, questions
    from calibration.bench.procedures.operator import AnswerNotUsable
    from calibration.bench.procedures.readings import estimate_of, parse_reading

    names = {"mass": "mass", "string-length": "string_length", "string-distance": "string_distance_top"}
    missing = [name for name in names if typed[name] is None]
    if len(missing) == len(names):
        return None
    if missing:
        raise AnswerNotUsable(f"--{missing[0]} is missing: mass, string length and string distance together")
    if tools not in TOOLS:
        raise AnswerNotUsable(f"--tools {tools}: choose {' or '.join(TOOLS)}")
    listed = questions(tools)
    values = {
        name: estimate_of([parse_reading(str(typed[name]), listed[key])], listed[key])
        for name, key in names.items()
    }
    distance = values["string-distance"]
    return Rig(mass=values["mass"], top=distance, bottom=distance, length=values["string-length"])


def _trial(fit: "SwingFit") -> dict[str, Any]:
    return {
        "file": fit.source,
        "period_s": fit.period.value,
        "crossing_period_s": fit.crossing_period,
        "cycles": fit.cycles,
        "start_amplitude_rad": fit.start_amplitude,
        "end_amplitude_rad": fit.end_amplitude,
        "damping_ratio": fit.damping_ratio,
        "swing_share": fit.swing_share,
        "rejected": fit.rejected,
        "findings": fit.findings,
    }


def _swing_words(
    document: Mapping[str, Any], fits: Sequence["SwingFit"], result: "InertiaResult | None"
) -> str:
    lines = [
        f"{fit.source}: T0 {fit.period.value:.4f} s over {fit.cycles:.0f} cycles"
        + (" (rejected)" if fit.rejected else "")
        for fit in fits
    ]
    lines.append(f"period: {document['period_s']}")
    if result is None:
        lines.append("inertia: say --mass, --string-length and --string-distance")
    else:
        lines.append(f"inertia: {result.inertia}")
    return "\n".join([*lines, *(f"! {text}" for text in document["warnings"])])


def propeller_of(name: str, vehicle: "Vehicle") -> "PropellerMap":
    """The map of a named propeller, or the vehicle's own thrust coefficient.

    Raises:
        AnswerNotUsable: the vehicle has none. TachometerError: no such propeller.
    """
    from calibration.bench.motors.propellers import PropellerMap, propeller
    from calibration.bench.procedures.operator import AnswerNotUsable

    if name != "vehicle":
        return propeller(name)
    coefficient = vehicle.motors.thrust_coefficient
    if coefficient is None:
        raise AnswerNotUsable(f"{vehicle.name} has no motors.thrust_coefficient: name its --propeller")
    return PropellerMap("vehicle", 0.0, 0.0, coefficient.value, coefficient.source)


def fit_steps(files: Sequence[Path], vehicle: "Vehicle", propeller: "PropellerMap", blades: int) -> None:
    """Speed law and time constants from recorded steps of one motor.

    Raises:
        TachometerError: a file that cannot be read, or without steps.
        CopiedRecordingError: a recording is given twice.
    """
    from calibration.bench.copies import refuse_copies
    from calibration.bench.motors.analysis import analyse
    from calibration.bench.motors.files import read_tachometer
    from onboard.gravity import GRAVITY

    hover = vehicle.body.mass.value * GRAVITY / 4.0
    records = [read_tachometer(file) for file in files]
    refuse_copies(zip(files, (record.measured for record in records), strict=True))
    result = analyse(records, propeller, hover, blades)
    emit(result, _step_words(result))


def _step_words(result: "TachometerResult") -> str:
    lines = [
        f"{name}: {one} (first order in thrust)"
        for name, one in (("tau_up", result.tau_up), ("tau_down", result.tau_down))
        if one is not None
    ]
    for way, law in (("up", result.up), ("down", result.down)):
        if law is not None:
            lines.append(f"{way}: a {law.a}, b {law.b}, rms {law.fit.rms:.1f} rad/s")
    return "\n".join([*lines, *(f"! {finding.text}" for finding in result.findings)])


def fit_table(file: Path, force_unit: str, motors: int | None) -> None:
    """Thrust maps from a table, or the published maps that it holds.

    Raises:
        ThrustTableError: the table cannot be read or fitted.
    """
    from calibration.bench.thrust.analysis import analyse, read_table
    from calibration.bench.thrust.thrust_result import imported_json
    from calibration.bench.thrust.units import Units

    table = read_table(file, Units(force=force_unit, motors=motors))
    if isinstance(table, dict):
        emit(
            imported_json(table), "\n".join(f"{name}: {one.form.name.lower()}" for name, one in table.items())
        )
        return
    result = analyse(table)
    document = as_json(result)
    lines = [
        f"{name}: rms {form['rms_gf']:.3f} gf, left out {form['cross_validation_gf']:.3f} gf"
        + (" <- chosen" if name == document["chosen"] else "")
        for name, form in document["forms"].items()
    ]
    emit(document, "\n".join([*lines, *(f"! {finding.text}" for finding in result.findings)]))
