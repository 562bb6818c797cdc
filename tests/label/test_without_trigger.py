"""A flight without a trigger did not flip only where something says so."""

from pathlib import Path

import pytest

from calibration.flights import open_flight
from onboard.vehicle import load_vehicle
from perchhw.attempt import Outcome
from perchhw.label import LabelError, label_flight


@pytest.mark.parametrize("cells", ["0,0,1,0,0,0,1", ",,,,,,"], ids=["upright", "no pose"])
def test_what_nobody_saw_is_no_missed_trigger(cells: str, tmp_path: Path) -> None:
    table = tmp_path / "flight.csv"
    rows = "".join(f"{0.01 * k:.2f},{cells},4.0\n" for k in range(100))
    table.write_text(f"t,x,y,z,qx,qy,qz,qw,vbat\n{rows}")
    flight, vehicle = open_flight(table, "table"), load_vehicle("crazyflie21-upgraded")
    if cells[0] == "0":
        assert label_flight(flight, vehicle).outcome is Outcome.NO_TRIGGER
        return
    with pytest.raises(LabelError, match="no attitude and no column triggered"):
        label_flight(flight, vehicle)
