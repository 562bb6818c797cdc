"""Checks of readings that no simulated part gives: other firmware, disks, radios, moving drones."""

import dataclasses
import re
from pathlib import Path

import pytest

from onboard.app_interface import INTERFACE_VERSION, Parameter
from onboard.firmware.constants import vehicle_crc32
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from onboard.vehicle import load_vehicle
from perchhw.doctor import CheckResult, CheckVerdict, examine
from perchhw.doctor.drone_checks import REVISION, SETTINGS
from perchhw.doctor.measure import host_readings
from perchhw.doctor.readings import DroneReadings, HostReadings, MocapReadings, Readings, UsbDevice
from perchhw.doctor.usb import usb_devices
from perchhw.supervisor import SafetyLimits

PAGE = Path(__file__).parents[2] / "docs" / "doctor.md"
VEHICLE = load_vehicle("crazyflie21-upgraded")
HOST = HostReadings(folder="runs", disk_free=10**10, disk_problem=None, usb=(), lab_problem=None)
DRONE = DroneReadings(
    round_trips=(0.004, 0.005, 0.006),
    parameters={
        REVISION: 0x2A18FC29,
        Parameter.VERSION: INTERFACE_VERSION,
        Parameter.VEHICLE_CRC: vehicle_crc32(VEHICLE),
        Parameter.REHEARSE: 0,
        **{name: needed for name, (needed, _, _) in SETTINGS.items()},
    },
    missing=(),
    app_memory_problem=None,
    supervisor=SupervisorInfo(int(SupervisorBits.CAN_ARM)),
    voltage=4.0,
    acceleration=(0.0, 0.0, 1.0),
    clock_rate=1.0,
)
MOCAP = MocapReadings(verdict="ok", error=None, rate=100.0, age=0.01, attitude=(0.0, 0.0, 0.0, 1.0))
ALL = Readings(
    host=HOST, vehicle=VEHICLE, drone_uri="udp://h:1", drone=DRONE, mocap_uri="vicon://h", mocap=MOCAP
)


def missing(readings: Readings) -> dict[str, CheckResult]:
    return {finding.what: finding for finding in examine(readings) if finding.missing}


def with_drone(**changes: object) -> Readings:
    return dataclasses.replace(ALL, drone=dataclasses.replace(DRONE, **changes))  # type: ignore[arg-type]


def with_mocap(**changes: object) -> Readings:
    return dataclasses.replace(ALL, mocap=dataclasses.replace(MOCAP, **changes))  # type: ignore[arg-type]


def with_host(**changes: object) -> Readings:
    return dataclasses.replace(ALL, host=dataclasses.replace(HOST, **changes))  # type: ignore[arg-type]


def test_where_all_is_fine_nothing_is_missing() -> None:
    assert missing(ALL) == {}
    assert all(not finding.remedy for finding in examine(ALL))


@pytest.mark.parametrize(
    ("what", "readings"),
    [
        ("link", with_drone(round_trips=(0.1, 0.2, 0.3))),
        ("landing_app", with_drone(missing=("perch.state",))),
        (
            "arming",
            with_drone(supervisor=SupervisorInfo(int(SupervisorBits.CAN_ARM | SupervisorBits.AUTO_ARM))),
        ),
        ("drone_state", with_drone(supervisor=SupervisorInfo(int(SupervisorBits.LOCKED)))),
        ("battery", with_drone(voltage=4.6)),
        ("battery", with_drone(voltage=None)),
        ("battery", dataclasses.replace(ALL, limits=SafetyLimits(battery_at_rest=4.1))),
        ("drone_clock", with_drone(clock_rate=0.9)),
        ("drone_clock", with_drone(clock_rate=None)),
        ("mocap", with_mocap(verdict="occluded")),
        ("mocap_rate", with_mocap(rate=50.0)),
        ("mocap_latency", with_mocap(age=0.05)),
        ("mocap_latency", with_mocap(age=None)),
        ("mocap_frame", with_mocap(attitude=(1.0, 0.0, 0.0, 0.0))),
        ("mocap_frame", with_mocap(attitude=None)),
        ("mocap_frame", with_drone(acceleration=(0.0, 0.0, 1.3))),
        ("disk", with_host(disk_free=10**8)),
        ("disk", with_host(disk_free=None)),
        ("disk", with_host(disk_problem="No space left on device")),
        ("lab_file", with_host(lab_problem="describe the room")),
        ("usb", dataclasses.replace(ALL, drone_uri="radio://0/80/2M")),
    ],
)
def test_each_bad_reading_is_one_line_with_a_remedy(what: str, readings: Readings) -> None:
    found = missing(readings)
    assert set(found) == {what}
    assert found[what].remedy


def test_a_drone_that_somebody_has_armed_is_said_to_be_armed() -> None:
    """An armed drone cannot be armed: that is not what is wrong with it."""
    armed = with_drone(supervisor=SupervisorInfo(int(SupervisorBits.ARMED)))
    assert missing(armed)["drone_state"].measured == "armed"
    assert missing(with_drone(supervisor=SupervisorInfo(0)))["drone_state"].measured == "cannot arm"


@pytest.mark.parametrize("mode", [1, 2])
def test_a_rehearsal_that_was_left_on_is_found(mode: int) -> None:
    left_on = with_drone(parameters={**DRONE.parameters, Parameter.REHEARSE: mode})
    assert set(missing(left_on)) == {"rehearsal"}


def test_stock_firmware_is_named_with_what_works_without_the_app() -> None:
    stock = {name: value for name, value in DRONE.parameters.items() if not name.startswith("perch.")}
    found = missing(with_drone(parameters=stock, missing=("perch.state",), app_memory_problem="none"))
    assert set(found) == {"landing_app", "app_memory"}
    assert found["landing_app"].measured == "none"
    assert "hover and test flights work without it" in found["landing_app"].why


@pytest.mark.parametrize("name", SETTINGS)
def test_a_setting_that_the_firmware_does_not_have_is_not_good(name: str) -> None:
    others = {key: value for key, value in DRONE.parameters.items() if key != name}
    assert missing(with_drone(parameters=others))[name].verdict is CheckVerdict.UNKNOWN


def test_a_vehicle_without_margin_is_found() -> None:
    slow = dataclasses.replace(VEHICLE.motors.time_constant_down, value=0.5)
    vehicle = dataclasses.replace(
        VEHICLE, motors=dataclasses.replace(VEHICLE.motors, time_constant_down=slow)
    )
    assert "attitude_loop" in missing(dataclasses.replace(ALL, vehicle=vehicle))


def test_a_radio_without_rights_is_named() -> None:
    radio = UsbDevice(name="Crazyradio", node="/dev/bus/usb/001/004", usable=False)
    readings = dataclasses.replace(with_host(usb=(radio,)), drone_uri="radio://0/80/2M")
    assert "no rights" in missing(readings)["usb"].measured
    usable = with_host(usb=(dataclasses.replace(radio, usable=True),))
    assert missing(dataclasses.replace(usable, drone_uri="radio://0/80/2M")) == {}


def test_radios_are_found_as_linux_lists_them(tmp_path: Path) -> None:
    listed, nodes = tmp_path / "devices", tmp_path / "nodes"
    for number, (vendor, product) in enumerate((("1915", "7777"), ("1d6b", "0002")), start=1):
        folder = listed / f"1-{number}"
        folder.mkdir(parents=True)
        for name, text in (
            ("idVendor", vendor),
            ("idProduct", product),
            ("busnum", "1"),
            ("devnum", str(number)),
        ):
            (folder / name).write_text(text + "\n", encoding="ascii")
    assert usb_devices(listed, nodes) == (
        UsbDevice(name="Crazyradio", node=str(nodes / "001" / "001"), usable=False),
    )
    (nodes / "001").mkdir(parents=True)
    (nodes / "001" / "001").touch()
    assert usb_devices(listed, nodes)[0].usable


def test_a_folder_that_takes_no_file_is_found() -> None:
    host = host_readings(None, None, None, Path("/proc"))
    assert host.disk_problem


def test_the_page_has_a_row_for_every_line() -> None:
    rows = re.findall(r"^\| `([\w.]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    usb = with_host(lab_problem="describe the room")
    lines = examine(dataclasses.replace(usb, drone_uri="radio://0/80/2M"))
    assert rows == [finding.what for finding in lines]


def test_without_a_dongle_nobody_asks_whether_the_drone_is_on() -> None:
    silent = dataclasses.replace(ALL, drone_uri="radio://0/80/2M", drone="cannot open: no Crazyradio")
    assert missing(silent)["link"].remedy == "plug in a Crazyradio first: no drone was asked"
    by_network = dataclasses.replace(silent, drone_uri="udp://h:1")
    assert "is it on" in missing(by_network)["link"].remedy
