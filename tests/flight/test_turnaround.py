"""Between two attempts a stop by anybody of this machine counts, though the next reboot would undo it."""

import subprocess
import sys
from pathlib import Path

import pytest

from onboard.link import machine_files
from onboard.link.errors import DroneStopped
from onboard.link.stop_note import StopsSince, note_stop
from onboard.supervisor_info import SupervisorBits
from perchhw.flight.turnaround import Turnaround
from tests.link.tiny_drone import TinyDrone
from tests.patience import PATIENCE_S

POWER = 0xFF


def perchhw_stop(drone: str) -> None:
    command = [sys.executable, "-m", "perchhw", "stop", "--drone", drone]
    subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE_S)


def reboots(drone: TinyDrone) -> int:
    return sum(request[:1] == bytes([POWER]) for request in drone.requests)


def test_a_stop_at_the_operators_question_ends_it_before_the_reboot() -> None:
    with TinyDrone() as drone:
        turnaround = Turnaround(drone.uri, confirm=lambda _what: perchhw_stop(drone.uri))
        with pytest.raises(DroneStopped, match=r"find out why"):
            turnaround.put_back()
        assert reboots(drone) == 0
        with pytest.raises(DroneStopped):  # however often one tries
            turnaround.put_back()

        Turnaround(drone.uri, confirm=lambda _what: None).put_back()  # who begins anew has seen it
        assert reboots(drone) > 0


@pytest.mark.parametrize(
    ("said", "put_back"),
    [
        (SupervisorBits.CAN_ARM, False),
        (SupervisorBits.LOCKED, True),
        (SupervisorBits.TUMBLED | SupervisorBits.CAN_ARM, True),
        (SupervisorBits.FLYING | SupervisorBits.CAN_FLY, False),
    ],
)
def test_a_drone_is_put_back_before_a_first_flight_where_it_has_flown(
    said: SupervisorBits, put_back: bool
) -> None:
    asked: list[str] = []
    with TinyDrone() as drone:
        drone.supervisor_bits = int(said)
        Turnaround(drone.uri, confirm=asked.append).put_back_if_needed()
        assert (reboots(drone) > 0) is put_back
    assert [("start mark" in request) for request in asked] == [True] * put_back


@pytest.mark.usefixtures("own_drone_files")
def test_a_drone_that_does_not_answer_is_left_to_its_flight() -> None:
    Turnaround("udp://127.0.0.1:9", confirm=pytest.fail).put_back_if_needed()


def test_a_stop_of_another_drone_says_nothing_about_this_one() -> None:
    with TinyDrone() as drone, TinyDrone() as other:
        Turnaround(drone.uri, confirm=lambda _what: perchhw_stop(other.uri)).put_back()
        assert reboots(drone) > 0


@pytest.mark.usefixtures("own_drone_files")
def test_a_stop_is_noted_for_every_address_of_the_drone() -> None:
    stops = StopsSince("radio://0/80/2M/E7E7E7E7E7")
    stops.check()
    note_stop("radio://1/80/2M/E7E7E7E7E8")
    stops.check()
    note_stop("radio://1/80")
    with pytest.raises(DroneStopped):
        stops.check()


def test_where_no_note_can_be_kept_that_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(machine_files, "FOLDER", tmp_path / "file" / "notes")
    note_stop("udp://127.0.0.1:9")
    (said,) = caplog.records
    assert "cannot note the stop" in said.getMessage()
