"""Find the gap in the campaign's own records, as ``perchhw gap find`` does."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calibration.flights import Flight, flight_files, open_flight
from calibration.gap.data.record import NotUsed
from calibration.gap.find import GapQuestion, find_gap
from calibration.gap.report import write_report
from calibration.gap.report.improved_vehicle import write_vehicle
from onboard.errors import InputError
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.walkthrough.gap.story import BELIEVED


def find_in_records(folder: Path, records: Sequence[Path], seed: int) -> dict[str, Any]:
    """Hold the believed vehicle against the records; report and improved vehicle go into `folder`.

    Returns:
        ``verdict``, ``effects`` (values and intervals by name and parameter), ``ambiguous``, and ``vehicle``.
    """
    flights: list[Flight] = []
    unusable: list[NotUsed] = []
    for file in flight_files(records):
        try:
            flights.append(open_flight(file, "perchhw"))
        except InputError as error:
            unusable.append(NotUsed(str(file), str(error)))
    asked = GapQuestion(
        vehicle=load_vehicle(BELIEVED),
        seed=seed,
        ceiling_z=RoomGeometry().ceiling_z,
        unusable=unusable,
    )
    result = find_gap(flights, asked)
    write_report(result.report, folder, result.figures)
    vehicle = write_vehicle(result.vehicle, folder)
    return {
        "verdict": str(result.report.verdict),
        "effects": {
            effect.name: {
                name: {"value": one.value, "ci95": list(one.ci95)} for name, one in effect.parameters.items()
            }
            for effect in result.report.effects
        },
        "ambiguous": {effect.name: list(effect.ambiguous_with) for effect in result.report.effects},
        "vehicle": str(vehicle),
    }
