"""``perchhw bringup``: the ladder to the first flight."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli import exit_codes
from perchhw.cli.lab_options import LabDrone, LabMocap, LabPolicy, LabVehicle
from perchhw.cli.options import Lab
from perchhw.cli.output import emit
from perchhw.consoles import progress_console
from perchhw.operator_signals import ending_in_order

if TYPE_CHECKING:
    from perchhw.bringup.passes import Passes
    from perchhw.bringup.reaction import Reaction
    from perchhw.doctor import CheckResult
    from perchhw.lab.setup import FlightSetup
    from perchhw.screen.display import Display

app = typer.Typer(add_completion=False)

_ON_ITS_MARK = "Put the drone upright on its start mark facing +x"


@app.command()
def bringup(
    step: Annotated[
        str | None,
        typer.Option(help="motors, tilt, hover, step, approach or landing; none: show what has passed."),
    ] = None,
    lab: Lab = None,
    drone: LabDrone = None,
    mocap: LabMocap = None,
    policy: LabPolicy = None,
    vehicle: LabVehicle = None,
    speed: Annotated[float, typer.Option(help="Of the first landing, on the approach line, m/s.")] = 2.5,
    angle: Annotated[float, typer.Option(help="Of the approach line above the horizon, deg.")] = 50.0,
    out: Annotated[Path, typer.Option(help="Folder for the records.")] = Path("runs"),
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask whether the drone stands ready.")] = False,
    confirm: Annotated[
        str | None, typer.Option(help="motors: the phrase that unlocks them, typed in advance.")
    ] = None,
    saw: Annotated[
        str | None,
        typer.Option(
            help='motors: what was seen to turn, "1 ccw,2 cw,3 ccw,4 cw"; or "1,2,3,4" where the gyro tells.'
        ),
    ] = None,
) -> int:
    """Climb the ladder to the first flight: motors, tilt, hover, step, approach, landing.

    Each step is refused until the one below has passed today, on this drone as this vehicle, and until the
    doctor finds nothing missing. A step that does not pass takes back what stood on it.

    Exit codes: 0 passed (or the ladder shown), 1 not passed, 2 input that cannot be used, 3 refused.
    """
    from datetime import datetime

    from onboard.firmware.constants import vehicle_crc32
    from onboard.link.exclusive import hold
    from onboard.vehicle import load_vehicle
    from perchhw.bringup.climb import climb, doctors_look
    from perchhw.bringup.passes import STEPS, Passes, passes_file
    from perchhw.lab import find_lab, flies_by_own_law, flight_setup

    if step is not None and step not in STEPS:
        raise typer.BadParameter(f"{step!r} is no step; the steps are {', '.join(STEPS)}")
    setup = flight_setup(find_lab(lab), drone=drone, mocap=mocap, vehicle=vehicle, policy=policy)
    setup.check()
    crc = vehicle_crc32(load_vehicle(setup.vehicle, setup.legs))
    own_law = flies_by_own_law(setup.lab, setup.drone)
    passes = Passes(setup.drone, crc, datetime.now().astimezone().date(), passes_file(), own_law)
    if step is None:
        _show(passes)
        return exit_codes.DONE
    passes.require(step)
    with hold(setup.drone), _display(step, setup.drone) as display:
        if display is not None:
            _put_back(setup.drone, yes, display)
        run = _runner(step, setup, out, speed, angle, display, confirm, saw)
        findings = climb(step, passes, lambda: doctors_look(setup, out), run)
    _tell(step, findings)
    return exit_codes.FAILED if any(one.missing for one in findings) else exit_codes.DONE


def _display(step: str, drone: str) -> "AbstractContextManager[Display | None]":
    """Where the steps that fly are shown; the others ask the operator as they go."""
    from perchhw.screen.flight_display import flight_display

    return nullcontext() if step in ("motors", "tilt") else flight_display(f"bringup {step}", drone)


def _put_back(drone: str, yes: bool, display: "Display") -> None:
    from perchhw.cli.prompts import confirmation
    from perchhw.flight.turnaround import Turnaround

    Turnaround(drone, confirmation(yes, display), _ON_ITS_MARK).put_back()


def _runner(
    step: str,
    setup: "FlightSetup",
    out: Path,
    speed: float,
    angle: float,
    display: "Display | None",
    phrase: str | None,
    saw: str | None,
) -> "Callable[[], tuple[CheckResult, ...]]":
    """What flies, turns or watches in `step`."""
    from perchhw.bringup.flights import Flights
    from perchhw.bringup.tilt import tilt

    screen = progress_console()
    flights = Flights(setup, out, speed, angle, display)
    steps: dict[str, Callable[[], tuple[CheckResult, ...]]] = {
        "motors": lambda: _motors(setup.drone, phrase, saw),
        "tilt": lambda: tilt(setup, lambda request: screen.print(f"{request}.", markup=False)),
        "hover": flights.hover,
        "step": flights.step,
        "approach": flights.approach,
        "landing": flights.landing,
    }
    return steps[step]


def _motors(drone: str, phrase: str | None, saw: str | None) -> "tuple[CheckResult, ...]":
    from perchhw.bringup.motors import motors

    with ending_in_order():
        return motors(drone, phrase or _phrase(), _eyes(saw))


def _phrase() -> str:
    from onboard.app_interface import MOTOR_STOP_MS
    from perchhw.bringup.motors import UNLOCK_PHRASE

    return _answer(
        "Take the propellers OFF. Hang the drone level on a thread, free to turn, and calm it: then its gyro "
        "tells which way each motor turns. Or hold it fast, and see that yourself. If this program dies, "
        f"nothing but the app on the drone stops the motors, within {1e-3 * MOTOR_STOP_MS:g} s. "
        f"Type {UNLOCK_PHRASE!r}: "
    )


def _eyes(saw: str | None) -> "Callable[[int, Reaction], str]":
    """What the operator saw: given in advance, or asked; the direction only where the gyro cannot tell."""
    if saw is not None:
        answers = saw.split(",")
        return lambda motor, _: answers[motor - 1] if motor <= len(answers) else ""
    which = "Which motor turned (1 front right, 2 back right, 3 back left, 4 front left)"
    way = ", and which way seen from above, cw or ccw"
    return lambda _, felt: _answer(f"{which}{way if felt.direction is None else ''}? ")


def _answer(question: str) -> str:
    from perchhw.errors import NobodyToAsk

    try:
        return progress_console().input(question, markup=False)
    except (EOFError, OSError) as error:
        raise NobodyToAsk("nobody answers: give --confirm and --saw") from error


def _show(passes: "Passes") -> None:
    from perchhw.bringup.passes import STEPS

    passed = passes.passed
    following = next((step for step in STEPS if step not in passed), None)
    document = {
        "drone": passes.drone,
        "vehicle_crc32": f"{passes.vehicle_crc:08x}",
        "day": passes.day.isoformat(),
        "passed": list(passed),
        "next": following,
    }
    words = [f"{'passed' if step in passed else '-':8}{step}" for step in STEPS]
    words.append(
        "the ladder is climbed" if following is None else f"next: perchhw bringup --step {following}"
    )
    emit(document, "\n".join(words))


def _tell(step: str, findings: "tuple[CheckResult, ...]") -> None:
    from perchhw.cli.doctor import in_words

    passed = not any(one.missing for one in findings)
    document = {"step": step, "pass": passed, "findings": findings}
    lines = [f"{step} {'passed' if passed else 'FAILED'}", *map(in_words, findings)]
    emit(document, "\n".join(lines))
