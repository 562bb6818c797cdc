"""A folder of flights with something hidden in them, and the answer in a sealed file elsewhere."""

import json
from pathlib import Path

from tests.truth.hidden_effects.cases import hide
from tests.truth.hidden_effects.defects import with_defects
from tests.truth.hidden_effects.flight import hidden_flight
from tests.truth.hidden_effects.layout import nominal
from tests.truth.hidden_effects.log_file import write_log
from tests.truth.hidden_effects.shapes import campaign

VEHICLE = "crazyflie21-stock"


def make_flights(
    case: str,
    size: str,
    seed: int,
    flights: int = 20,
    *,
    out: Path,
    answer: Path,
    defects: bool = False,
    vehicle: str = VEHICLE,
) -> list[Path]:
    """Fly a campaign with a hidden case and write its logs.

    Args:
        case: of `cases.CASES`.
        size: "weak", "medium" or "strong".
        seed: of everything that is random.
        flights: how many.
        out: folder for the logs, made if absent.
        answer: file for the answer, outside `out`.
        defects: the second tier: slow torque, and logs as a radio and two clocks leave them.
        vehicle: name in the library of the vehicle that the finder is given.

    Returns:
        The logs written.

    Raises:
        ValueError: unknown case or size, or an answer that would lie beside the flights.
    """
    if answer.resolve().is_relative_to(out.resolve()):
        raise ValueError(f"the answer {answer} must not lie in the flights' folder {out}")
    hidden = hide(case, size, seed, nominal(vehicle))
    out.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, (name, shape) in enumerate(campaign(flights)):
        flight = hidden_flight(hidden.vehicle, name, shape, seed, number, defects=defects)
        log = with_defects(flight, seed, number, dead=number == flights - 1) if defects else flight.log
        paths.append(out / f"{name}.csv")
        write_log(paths[-1], log)
    sealed = hidden.answer(
        case=case,
        size=size,
        seed=seed,
        vehicle=vehicle,
        defects=defects,
        flights=[path.name for path in paths],
    )
    answer.parent.mkdir(parents=True, exist_ok=True)
    answer.write_text(json.dumps(sealed, indent=1) + "\n")
    return paths
