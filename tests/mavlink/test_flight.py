"""A flight that a ground station watches over a bad link; nothing that it does reaches the drone."""

import json
import logging
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from perchhw.flight.ground_station import ground_station
from perchhw.flight.recording import FlightRecorder
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import RunRecorder, read_run
from tests.mavlink.ground import Listener

UNKNOWN_MV = 0xFFFF


class Watching:
    """Takes all that is told, in a thread, and asks the vehicle to arm all the time."""

    def __init__(self, station: Listener) -> None:
        self.messages: list[Any] = []
        self._station = station
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def _watch(self) -> None:
        while not self._stop.is_set():
            for message in self._station.messages(seconds=0.2):
                self.messages.append(message)
                if message.get_type() in ("HEARTBEAT", "SYS_STATUS", "STATUSTEXT"):
                    self._station.send(
                        ardupilotmega.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0)
                    )

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.messages if message.get_type() == kind]

    def __enter__(self) -> "Watching":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()


@pytest.mark.further
def test_a_ground_station_follows_a_flight_that_loses_its_poses(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    arguments = (*FREE_PORTS, *LOCKSTEP, "--seed", "7", "--fault", "mocap_occlude_at=6:60")
    with (
        SimulatedLab("lab", arguments) as lab,
        Listener(keep=lambda: rng.random() >= 0.3) as station,
        Watching(station) as watching,
    ):
        flown = subprocess.run(
            [
                *(sys.executable, "-m", "perchhw", "--json", "fly", "--speed", "2.5", "--angle", "52.5"),
                *("--drone", lab.drones[0], "--mocap", lab.mocap[0], "--out", str(tmp_path), "--yes"),
                *("--mavlink", f"mavlink://127.0.0.1:{station.port}"),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
    result = json.loads(flown.stdout)
    assert flown.returncode == 3, flown.stderr
    record = read_run(Path(result["record"]))

    told = {message.id: message.text.partition(" ")[2] for message in watching.of("STATUSTEXT") if message.id}
    assert sorted(told) == list(range(1, len(told) + 1)), "a line about safety was lost"
    said = " ".join(told[number] for number in sorted(told))
    assert re.sub(r"\s+", " ", f"aborted: {result['aborted_by']}") in said
    plain = {message.text for message in watching.of("STATUSTEXT") if not message.id}
    assert plain & {"taking off", "moving to start", "landing", "done"}
    answers = {message.result for message in watching.of("COMMAND_ACK")}
    assert answers == {ardupilotmega.MAV_RESULT_DENIED}

    estimates = {
        (round(m["x"], 5), round(m["y"], 5), round(m["z"], 5))
        for m in record.series["estimate"].messages
        if "x" in m
    }
    shown = {(round(m.y, 5), round(m.x, 5), round(-m.z, 5)) for m in watching.of("LOCAL_POSITION_NED")}
    assert len(shown) > 20
    assert shown <= estimates
    states = {message.system_status for message in watching.of("HEARTBEAT")}
    assert states <= {3, 4, 5}
    voltages = [1000.0 * m["vbat"] for m in record.series["power"].messages if "vbat" in m]
    told_voltages = {m.voltages[0] for m in watching.of("BATTERY_STATUS")} - {UNKNOWN_MV}
    assert told_voltages
    for voltage in told_voltages:  # which of them were lost on the way is the network's luck
        assert any(voltage == pytest.approx(known, abs=1.0) for known in voltages)


class Broken:
    """A listener that fails."""

    def __init__(self) -> None:
        self.asked = 0

    def write(self, topic: str, t: float, values: object) -> None:
        self.asked += 1
        raise RuntimeError("the ground station has burnt down")

    def event(self, name: str, t: float, fields: object) -> None:
        self.asked += 1
        raise RuntimeError("the ground station has burnt down")


def test_a_listener_that_fails_is_dropped_and_the_record_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    broken = Broken()
    record = FlightRecorder(RunRecorder(tmp_path / "run", {}), broken)
    with caplog.at_level(logging.ERROR):
        for i in range(3):
            record.write("power", float(i), {"vbat": 4.0})
            record.event("phase", float(i))
    record.close()
    assert broken.asked == 1
    assert record.look_for_loss() is None
    assert len(read_run(tmp_path / "run").series["power"].messages) == 3
    assert "it goes on" in caplog.text


def test_without_an_address_there_is_no_listener() -> None:
    with ground_station(None) as listener:
        assert listener is None


def test_an_emergency_stop_is_told(tmp_path: Path) -> None:
    with Listener() as station, ground_station(f"mavlink://127.0.0.1:{station.port}") as listener:
        record = FlightRecorder(RunRecorder(tmp_path / "run", {}), listener)
        record.event("command", 1.0, command="EmergencyStop()", number=3)
        record.event("StopUnconfirmed", 1.1, what="StopUnconfirmed(reason='nothing was heard')")
        record.event("phase", 1.2, phase="stopping", aborted_by="fence: 0.3 m outside")
        record.close()
        assert station.until("STATUSTEXT").text == "#1 emergency stop: motors are cut"
        assert "StopUnconfirmed" in station.until("STATUSTEXT", lambda m: m.id == 2).text
        assert station.until("HEARTBEAT", lambda m: m.system_status == 6)
