"""A wizard from its instruments to its report: opens everything, runs, fits, writes, and lets all go."""

import shutil
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibration.bench.instruments.addresses import AnySupply, ScaleAddress, SupplyAddress
from calibration.bench.instruments.gyro_recorder import GyroRecorder
from calibration.bench.instruments.kept_supply import KeptSupply
from calibration.bench.instruments.line_device import LineInstrument
from calibration.bench.instruments.motor_stand import MotorStand
from calibration.bench.instruments.tachometer import Tachometer
from calibration.bench.procedures import discharge, inertia, motors, thrust
from calibration.bench.procedures.by_hand import OperatorAsPerson
from calibration.bench.procedures.calibration import Calibration, load_calibration, write_calibration
from calibration.bench.procedures.compare import Comparison, compare_calibrations, compare_with_vehicle
from calibration.bench.procedures.conclude import (
    CAPTURE,
    capture_calibration,
    capture_figures,
    inertia_calibration,
    inertia_figures,
    motor_calibration,
    motor_figures,
    thrust_calibration,
    thrust_figures,
)
from calibration.bench.procedures.operator import Operator, StepBack, Task
from calibration.bench.procedures.report import write_report
from calibration.bench.procedures.run_book import RunBook
from calibration.bench.procedures.thrust_recording import ThrustStand
from onboard.link import DroneLink
from onboard.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from calibration.bench.capture.fit import CaptureFit


@dataclass(frozen=True)
class Stand:
    """What is connected.

    Attributes:
        drone: URI.
        instrument: port of the tachometer, or URI of the scale.
        supply: URI of the supply that feeds the drone, or None for its battery.
        voltage: V, of the supply at the start.
        no_remote_cut: the operator wants to do without a supply that can be switched off from here.
    """

    drone: str
    instrument: str
    supply: str | None
    voltage: float
    no_remote_cut: bool = False


@dataclass(frozen=True)
class Concluded:
    """A finished run.

    Attributes:
        calibration: as it was written.
        report: the page.
        comparisons: with the vehicle file and with an earlier fit, by their name.
    """

    calibration: Calibration
    report: Path
    comparisons: dict[str, list[Comparison]]


def measure_inertia(
    plan: inertia.InertiaPlan, drone: str, folder: Path, operator: Operator, provenance: Mapping[str, Any]
) -> Concluded:
    """The bifilar wizard on a drone's URI; goes on where a run in `folder` stopped.

    Raises:
        PerchhwError: of wizard, link or fit; what was recorded is kept.
    """
    book = RunBook(folder, inertia.KIND, plan.settings(), operator)
    if not book.steps:
        operator.do(
            Task(
                "place_on_floor", "Put the battery in, tape the propellers, switch the drone on, set it down."
            )
        )
    with DroneLink.open(drone) as link, GyroRecorder(link) as recorder:
        _until_done(book, inertia.InertiaWizard(plan, recorder).run)
    fits = inertia.fit_inertia(folder, book.steps, plan)
    told = {**provenance, "drone": drone, "tools": plan.tools, "skipped": book.skipped}
    return _conclude(folder, inertia_calibration(fits, _now(), told), plan.vehicle, inertia_figures(fits))


def measure_motors(
    plan: motors.MotorPlan, stand: Stand, folder: Path, operator: Operator, provenance: Mapping[str, Any]
) -> Concluded:
    """The tachometer wizard; as :func:`measure_inertia`. Motors off and supply off on every way out.

    Raises:
        MotorsRefused: no supply that could be switched off from here, and nobody wanted to do without.
        InstrumentInputError: an address that is none.
    """
    book = RunBook(folder, motors.KIND, plan.settings(), operator)
    feed = _feed(stand, operator)
    with ExitStack() as stack:
        supply = None if feed is None else _powered(feed, stand.voltage, operator, stack)
        link = stack.enter_context(DroneLink.open(stand.drone))
        tachometer = stack.enter_context(Tachometer(stand.instrument))
        tachometer.wait_as_long_as(link.patience)
        driven = stack.enter_context(_motor_stand(link, tachometer.check, supply, stand))
        _until_done(book, motors.MotorWizard(plan, driven, tachometer).run)
    fits = motors.fit_motors(folder, book.steps, plan)
    told = {**provenance, "drone": stand.drone, "propeller": plan.propeller.name, "skipped": book.skipped}
    return _conclude(folder, motor_calibration(fits, _now(), told), plan.vehicle, motor_figures(fits))


def measure_thrust(
    plan: thrust.ThrustPlan,
    stand: Stand,
    folder: Path,
    operator: Operator,
    provenance: Mapping[str, Any],
) -> Concluded:
    """The thrust wizard; as :func:`measure_motors`. It needs a supply.

    Raises:
        NoSupply: none was given. ScaleUnusable: a scale that cannot be used.
    """
    if stand.supply is None:
        raise thrust.NoSupply("the thrust run needs a supply whose voltage can be set")
    book = RunBook(folder, thrust.KIND, plan.settings(), operator)
    with ExitStack() as stack:
        ready = _thrust_stand(stand, operator, stack)
        _until_done(book, thrust.ThrustWizard(plan, ready).run)
    found = thrust.fit_thrust(folder, book.steps, plan)
    told = {**provenance, "drone": stand.drone, "skipped": book.skipped}
    return _conclude(
        folder, thrust_calibration(found, book.steps, _now(), told), plan.vehicle, thrust_figures(found)
    )


def measure_discharge(plan: discharge.DischargePlan, stand: Stand, folder: Path, operator: Operator) -> Path:
    """The discharge wizard; as :func:`measure_motors`. On a supply, or on the drone's battery.

    Returns:
        The table for :func:`~calibration.bench.thrust.compensation.verify`.
    """
    book = RunBook(folder, discharge.KIND, plan.settings(), operator)
    with ExitStack() as stack:
        ready = _thrust_stand(stand, operator, stack)
        _until_done(book, discharge.DischargeWizard(plan, ready).run)
    return discharge.join_discharges(folder, book.steps)


def conclude_capture(
    fit: "CaptureFit", table: Path, vehicle: Vehicle, folder: Path, operator: Operator,
    provenance: Mapping[str, Any],
) -> Concluded:  # fmt: skip
    """Result and report of drops; their table is kept in the run.

    Raises:
        RunBookError: the folder holds another kind of run.
    """
    book = RunBook(folder, CAPTURE, {}, operator)
    kept = book.keep_raw(
        "drops", partial(shutil.copyfile, table), ".csv.gz" if table.suffix == ".gz" else ".csv"
    )
    calibration = capture_calibration(fit, kept, _now(), provenance)
    return _conclude(folder, calibration, vehicle, capture_figures(fit))


def _thrust_stand(stand: Stand, operator: Operator, stack: ExitStack) -> ThrustStand:
    """The open instruments of a thrust stand; `stack` lets them go."""
    weigher, feed = ScaleAddress.of(stand.instrument), _feed(stand, operator)
    supply = None if feed is None else _powered(feed, stand.voltage, operator, stack)
    link = stack.enter_context(DroneLink.open(stand.drone))
    scale = weigher.open(OperatorAsPerson(operator))
    stack.callback(scale.close)
    if isinstance(scale, LineInstrument):
        scale.wait_as_long_as(link.patience)
    driven = stack.enter_context(_motor_stand(link, scale.check, supply, stand))
    return ThrustStand(driven, scale, supply)


def _feed(stand: Stand, operator: Operator) -> SupplyAddress | None:
    """Where the drone's power comes from; what nobody can cut from here, the operator must have wanted."""
    feed = None if stand.supply is None else SupplyAddress.of(stand.supply)
    if feed is None or not feed.can_be_cut:
        motors.confirm_no_remote_cut(operator, stand.no_remote_cut)
    return feed


def _motor_stand(
    link: DroneLink, check: Callable[[], None], supply: AnySupply | None, stand: Stand
) -> MotorStand:
    remote_cut = supply if isinstance(supply, KeptSupply) else None
    return MotorStand(link, instruments=[check], remote_cut=remote_cut, no_remote_cut=stand.no_remote_cut)


def _powered(feed: SupplyAddress, voltage: float, operator: Operator, stack: ExitStack) -> AnySupply:
    """The open supply, switched on; `stack` switches it off."""
    supply = feed.open(OperatorAsPerson(operator))
    stack.callback(supply.close)
    supply.set(voltage, thrust.CURRENT_LIMIT_A)
    supply.switch(on=True)
    return supply


def _until_done(book: RunBook, wizard: Callable[[RunBook], None]) -> None:
    """One step back means from the start, where finished steps are not done again."""
    while True:
        book.restart()
        try:
            wizard(book)
        except StepBack:
            continue
        return


def _now() -> str:
    """Wall time, for provenance only."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _conclude(
    folder: Path, calibration: Calibration, vehicle: Vehicle, figures: Mapping[str, "Figure"]
) -> Concluded:
    """Result and report of a run."""
    written = write_calibration(calibration, folder)
    comparisons = {f"the file of {vehicle.name}": compare_with_vehicle(vehicle, written)}
    if written.parent is not None:
        earlier = load_calibration(folder / f"result-{written.parent}.json")
        comparisons["the fit before"] = compare_calibrations(earlier, written)
    page = write_report(folder, written, figures, comparisons)
    return Concluded(written, page, comparisons)
