"""One step of the ladder: refused or not, the doctor first, then the step, and what comes of it is kept."""

from collections.abc import Callable
from pathlib import Path

from onboard.vehicle import load_vehicle
from perchhw.bringup.passes import Passes, StepRefused
from perchhw.doctor import CheckResult, examine, take_readings
from perchhw.lab.setup import FlightSetup

LISTEN_S = 2.0


def climb(
    step: str,
    passes: Passes,
    look: Callable[[], tuple[CheckResult, ...]],
    run: Callable[[], tuple[CheckResult, ...]],
) -> tuple[CheckResult, ...]:
    """Run `step` when all below it have passed and `look` finds nothing missing; keep whether it passed.

    Raises:
        StepRefused: a step below has not passed, or something is missing.
    """
    passes.require(step)
    missing = [finding for finding in look() if finding.missing]
    if missing:
        what = "; ".join(f"{one.what}: {one.measured} (wanted: {one.wanted})" for one in missing)
        raise StepRefused(f"{step} is refused: {what}; `perchhw doctor` says what to do")
    passes.begin(step)
    findings = run()
    if not any(finding.missing for finding in findings):
        passes.add(step)
    return findings


def doctors_look(setup: FlightSetup, out: Path) -> tuple[CheckResult, ...]:
    """What `perchhw doctor` says of this lab now."""
    readings = take_readings(
        drone=setup.drone,
        mocap=setup.mocap,
        vehicle=load_vehicle(setup.vehicle, setup.legs),
        lab=setup.lab,
        folder=out,
        seconds=LISTEN_S,
    )
    return examine(readings)
