"""The screen over real flights in the simulated lab: what is shown, and what the keys do to the drone."""

import itertools
import statistics
from collections.abc import Iterator
from pathlib import Path

import pytest

from onboard.link import DroneLink, reboot
from perchhw.lab_process import FREE_PORTS, SimulatedLab
from perchhw.record import RunRecord, read_run
from tests.flight.airborne import Witness, when_it_flies
from tests.screen.pressed import fly, from_space_to_motors_off
from tests.screen.terminal import Terminal

CAMPAIGN = """
schema = "perchhw.campaign/1"
name = "two"
drone = "{drone}"
mocap = "{mocap}"
order = "grid"

[grid]
speeds = [2.25, 2.5]
angles_deg = [52.5]
"""
KEY_WITHIN_S = 0.2


def the_only(folder: Path) -> RunRecord:
    (record,) = folder.iterdir()
    return read_run(record)


def orders(record: RunRecord) -> str:
    return " ".join(event["command"] for event in record.events if event["event"] == "command")


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    """At a pace at which a busy machine sees what is shown, and presses a key, before the flight is over."""
    with SimulatedLab("lab", (*FREE_PORTS, "--pace", "0.5", "--seed", "3")) as lab:
        yield lab


def test_space_locks_the_drone(lab: SimulatedLab, tmp_path: Path) -> None:
    with fly(lab, tmp_path / "space") as terminal:
        rows = terminal.until("waits for the first hover")
        assert "2.5 m/s, 50 deg" in rows[0]
        assert rows[1].startswith("● ● ● ● ▶ take-off ○ to start ○")
        terminal.until("policy CRC")
        terminal.until(" V ")
        terminal.press(" ")
        assert terminal.ended() == 130
    with DroneLink.open(lab.drones[0]) as link:
        assert link.supervisor_info().is_locked
    assert "EmergencyStop" in orders(the_only(tmp_path / "space"))


@pytest.mark.soak
def test_l_lands_however_often_and_the_prompt_has_its_place(lab: SimulatedLab, tmp_path: Path) -> None:
    with fly(lab, tmp_path / "land", "--put-back") as terminal:
        rows = terminal.until("press Enter")
        assert rows[-3].startswith("Put the drone upright on its start mark")
        terminal.press("\r")
        terminal.until("waits for the first hover")
        terminal.press("nl")
        terminal.until("landing, ")
        terminal.until("ended by operator")
        terminal.until("Note on taking off:")
        terminal.press("hops\r")
        assert terminal.ended() == 130
        terminal.until("aborted: operator")
    record = the_only(tmp_path / "land")
    assert "Land" in orders(record)
    assert "EmergencyStop" not in orders(record)
    notes = [(event["phase"], event["text"]) for event in record.events if event["event"] == "note"]
    assert notes == [("taking off", ""), ("taking off", "hops")]
    assert "hops" in (record.folder / "report.html").read_text()


@pytest.mark.soak
def test_a_campaign_at_120_columns(lab: SimulatedLab, tmp_path: Path) -> None:
    file, folder = tmp_path / "two.toml", tmp_path / "campaign"
    file.write_text(CAMPAIGN.format(drone=lab.drones[0], mocap=lab.mocap[0]))
    reboot(lab.drones[0])
    with Terminal("campaign", "run", str(file), "--out", str(folder), columns=120, lines=30) as terminal:
        terminal.until("attempt 1 of 2, 2.25 m/s, 52.5 deg")
        terminal.until("▶ take-off")
        terminal.press("pn")
        terminal.until("Note on taking off:")
        terminal.press("hops\r")
        terminal.until("Paused")
        terminal.press("\r")
        terminal.until("it may hang from the ceiling")
        terminal.press("\r")
        terminal.until("attempt 2 of 2")
        terminal.until("▶ take-off")
        assert terminal.shown()[-3] == ""
        terminal.process.terminate()
        assert terminal.ended() == 130
        terminal.until("continue with --resume")
    first, _ = sorted((folder / "attempts").iterdir())
    assert [e["text"] for e in read_run(first).events if e["event"] == "note"] == ["", "hops"]


@pytest.mark.soak
def test_the_key_at_real_pace(tmp_path: Path) -> None:
    """From the key to motors that may not turn, by the drone's own word."""
    folders = map(tmp_path.joinpath, map(str, itertools.count()))
    with SimulatedLab("lab", (*FREE_PORTS, "--seed", "3")) as lab:
        witness = Witness(lab.drones[0])
        times = [
            when_it_flies(lambda: from_space_to_motors_off(lab, witness, next(folders))) for _ in range(5)
        ]
        witness.close()
    assert statistics.median(times) < KEY_WITHIN_S, times
    assert max(times) < KEY_WITHIN_S, times
