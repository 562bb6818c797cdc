"""The doctor at a drone with something wrong: over the real link, from a firmware that was tampered with."""

from collections.abc import Callable
from pathlib import Path

import pytest

from onboard.app_interface import MEMORY_TYPE_APP, Parameter
from onboard.lab_file import LabFile, read_lab_file
from onboard.vehicle import load_vehicle
from perchhw.doctor import CheckResult, CheckVerdict, examine, take_readings
from perchhw.doctor.readings import Readings
from perchhw.lab.flying import LIMITS
from sim_backend.crazyflie.firmware import Firmware
from sim_backend.lab_faults import DroneFaults
from tests.lab_file.labs import LAB
from tests.patience import patient_uri
from tests.sim_crazyflie.served_flight import serve_flight
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight

Tampering = Callable[[Firmware], None]


def examined(flight: Flight, vehicle: str = VEHICLE) -> dict[str, CheckResult]:
    """The lines about a drone that is served in real time."""
    with serve_flight(flight) as served:
        readings = take_readings(
            drone=patient_uri(served.uri),
            mocap=None,
            vehicle=load_vehicle(vehicle),
            lab=None,
            folder=Path(),
            seconds=0.5,
        )
    return {finding.what: finding for finding in examine(readings)}


def parameter(name: str, value: float) -> Tampering:
    def tamper(firmware: Firmware) -> None:
        firmware.params[name] = value

    return tamper


def without_app_memory(firmware: Firmware) -> None:
    firmware.memories = tuple(m for m in firmware.memories if m.type_id != MEMORY_TYPE_APP)


TAMPERINGS: tuple[tuple[str, Tampering, str], ...] = (
    ("stabilizer.estimator", parameter("stabilizer.estimator", 1), "1"),
    ("stabilizer.controller", parameter("stabilizer.controller", 5), "5"),
    ("powerDist.idleThrust", parameter("powerDist.idleThrust", 7000), "7000"),
    ("motorPowerSet.enable", parameter("motorPowerSet.enable", 1), "1"),
    ("landing_app", parameter(Parameter.VERSION, 1), "version 1"),
    ("vehicle", parameter(Parameter.VEHICLE_CRC, 0x12345678), "12345678"),
    ("app_memory", without_app_memory, "memory"),
    ("rehearsal", parameter(Parameter.REHEARSE, 1), "on"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("what", "tamper", "measured"), TAMPERINGS, ids=[row[0] for row in TAMPERINGS])
def test_what_is_wrong_with_a_drone_is_found_alone(what: str, tamper: Tampering, measured: str) -> None:
    flight = Flight()
    tamper(flight.firmware)
    found = examined(flight)
    assert found[what].verdict is CheckVerdict.BAD
    assert measured in found[what].measured
    assert found[what].remedy
    # Round trip and clock rate are those of a busy machine here.
    others = {name for name, finding in found.items() if finding.missing} - {"link", "drone_clock"}
    assert others == {what}


@pytest.mark.slow
def test_a_low_battery_is_found() -> None:
    battery = examined(Flight(faults=DroneFaults(battery_voltage=3.6)))["battery"]
    assert battery.verdict is CheckVerdict.BAD
    assert battery.measured.startswith("3.6")


@pytest.mark.slow
def test_a_drone_that_is_built_for_another_vehicle_is_found() -> None:
    found = examined(Flight(flashed=load_vehicle("crazyflie21-stock", LEGS)))
    assert found["vehicle"].verdict is CheckVerdict.BAD
    assert "flash the firmware that was built for crazyflie21-upgraded" in found["vehicle"].remedy


@pytest.mark.slow
def test_an_unknown_revision_is_named_and_nothing_is_missing_by_it() -> None:
    flight = Flight()
    flight.firmware.params["firmware.revision0"] = 0xABCD1234
    firmware = examined(flight)["firmware"]
    assert firmware.verdict is CheckVerdict.NOTE
    assert "abcd1234" in firmware.measured
    assert not firmware.missing


def of_nobody(lab: LabFile | None) -> Readings:
    """What is read where no drone answers."""
    return take_readings(
        drone="udp://127.0.0.1:9",
        mocap=None,
        vehicle=load_vehicle(VEHICLE),
        lab=lab,
        folder=Path(),
        seconds=0.5,
    )


@pytest.mark.usefixtures("own_drone_files")
def test_a_drone_that_does_not_answer_is_one_line() -> None:
    links = [finding for finding in examine(of_nobody(lab=None)) if finding.what == "link"]
    assert [finding.verdict for finding in links] == [CheckVerdict.BAD]


@pytest.mark.usefixtures("own_drone_files")
def test_the_limits_are_those_of_the_lab_file(tmp_path: Path) -> None:
    """Else the doctor is content with a pack that no flight of this lab would take off with."""
    file = tmp_path / "lab.toml"
    file.write_text(LAB + "[limits]\nbattery_at_rest = 4.0\n", encoding="utf-8")
    assert of_nobody(read_lab_file(file, LIMITS)).limits.battery_at_rest == 4.0
