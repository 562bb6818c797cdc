"""A campaign over the real protocols: killed in flight, resumed, every condition done once."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.link import DroneLink
from onboard.link.stop_drone import stop_drone
from perchhw.campaign.turns import pack_use
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab

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

TURNS = """
schema = "perchhw.campaign/1"
order = "grid"

[grid]
speeds = [2.25]
angles_deg = [50.0, 52.5]

[day]
warm_up_s = 5
"""


FLIGHTS = """
schema = "perchhw.campaign/1"
drone = "{drone}"
mocap = "{mocap}"

[[flight]]
kind = "long_discharge"
times = 2
seconds = 5
"""


def campaign(*arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "perchhw", "--json", "campaign", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_flight(folder: Path, process: "subprocess.Popen[str]") -> None:
    """Until the second attempt is in the air: its record says that it takes off."""
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("1 of 2"):
            break
    wait_in_the_air(folder, process)


def wait_in_the_air(folder: Path, process: "subprocess.Popen[str]", name: str = "try1") -> None:
    while not in_the_air(folder, name):
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.05)
            pytest.fail("the campaign ended before its second attempt took off")


def in_the_air(folder: Path, name: str) -> bool:
    records = sorted((folder / "attempts").glob(f"*-001-{name}*/events.jsonl"))
    return bool(records) and "taking off" in records[0].read_text()


@pytest.mark.soak
def test_a_campaign_does_not_fly_a_drone_again_that_somebody_stopped(tmp_path: Path) -> None:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "6")) as lab:
        file = tmp_path / "two.toml"
        file.write_text(CAMPAIGN.format(drone=lab.drones[0], mocap=lab.mocap[0]))
        folder = tmp_path / "campaign"
        running = campaign("run", str(file), "--yes", "--out", str(folder))
        wait_for_flight(folder, running)
        stop = subprocess.run(
            [sys.executable, "-m", "perchhw", "stop", "--drone", lab.drones[0]],
            check=False,
            capture_output=True,
        )
        output, errors = running.communicate()
        with DroneLink.open(lab.drones[0]) as link:
            assert link.supervisor_info().is_locked, "it was rebooted"
    assert stop.returncode == 0, stop.stderr
    assert running.returncode == 3, errors
    document = json.loads(output)
    assert "somebody stopped the drone, not this flight" in document["stopped"]
    assert "stopped by others" in document["attempts"][-1]["aborted_by"]


@pytest.mark.soak  # tests/campaign kills and resumes without a lab; docs/flight_day.md flies one here
def test_a_campaign_killed_in_flight_resumes_without_losing_or_repeating(tmp_path: Path) -> None:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "5")) as lab:
        file = tmp_path / "two.toml"
        file.write_text(CAMPAIGN.format(drone=lab.drones[0], mocap=lab.mocap[0]))
        folder = tmp_path / "campaign"
        assert stop_drone(lab.drones[0]).locked, "as a flight before would leave it"
        first = campaign("run", str(file), "--yes", "--out", str(folder))
        wait_for_flight(folder, first)
        first.kill()
        first.communicate()

        remark = ("--operator", "Ada", "--note", "new pads")
        second = campaign("run", str(file), "--yes", "--resume", "--out", str(folder), *remark)
        output, errors = second.communicate()
    assert second.returncode == 0, errors
    document = json.loads(output)
    done = [row for row in document["attempts"] if row["state"] == "done"]
    assert [(row["speed"], row["try_number"]) for row in done] == [(2.25, 1), (2.5, 2)], document
    assert all(row["outcome"] != "aborted" for row in done), document
    interrupted = [row for row in document["attempts"] if row["state"] == "interrupted"]
    assert [row["slot"] for row in interrupted] == [1]
    config = json.loads((Path(done[1]["record"]) / "run.json").read_text())["config"]
    assert (config["operator"], config["note"]) == ("Ada", "new pads")
    assert (folder / "report.html").is_file()


@pytest.mark.soak
def test_test_flights_killed_in_the_air_resume_and_are_told_by_status(tmp_path: Path) -> None:
    file, folder = tmp_path / "flights.toml", tmp_path / "campaign"
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--seed", "5")) as lab:
        file.write_text(FLIGHTS.format(drone=lab.drones[0], mocap=lab.mocap[0]))
        first = campaign("run", str(file), "--yes", "--out", str(folder))
        wait_in_the_air(folder, first, "long-discharge")
        first.kill()
        first.communicate()
        halfway, _ = campaign("status", str(folder)).communicate()
        second = campaign("run", str(file), "--yes", "--resume", "--out", str(folder))
        output, errors = second.communicate()
    assert second.returncode == 0, errors
    assert [flight["done"] for flight in json.loads(halfway)["flights"]] == [True, False]
    document = json.loads(output)
    assert [flight["done"] for flight in document["flights"]] == [True, True], document
    told, _ = campaign("report", str(folder)).communicate()
    assert json.loads(told) == document
    assert len(list(folder.glob("attempts/*/report.html"))) == 3, "the one that was killed has a page, too"


@pytest.mark.soak
def test_two_drones_warm_up_and_fly_in_turn_as_long_as_forecast(tmp_path: Path) -> None:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--drones", "2", "--seed", "6")) as lab:
        file, folder = tmp_path / "turns.toml", tmp_path / "campaign"
        file.write_text(TURNS)
        drones = [word for uri in lab.drones for word in ("--drone", uri)]
        options = ["--lab", lab.ready["lab"], *drones]
        output, errors = campaign("run", str(file), *options, "--yes", "--out", str(folder)).communicate()
        planned, _ = campaign("plan", str(file), *options).communicate()
    document = json.loads(output)
    assert [row["aborted_by"] for row in document["attempts"]] == [None, None], errors
    flown = [pack_use(Path(row["record"])) for row in document["attempts"]]
    assert [use.drone for use in flown if use is not None] == lab.drones
    hovers = [pack_use(record) for record in sorted((folder / "warm-ups").iterdir())]
    in_the_air = sum(use.air_time for use in [*flown, *hovers] if use is not None)
    assert in_the_air == pytest.approx(json.loads(planned)["air_time_s"], rel=0.25)
    assert [use.drone for use in hovers if use is not None and use.air_time > 5.0] == lab.drones
