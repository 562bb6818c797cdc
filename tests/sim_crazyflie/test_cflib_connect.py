"""Unmodified cflib over a real socket: tables, parameters, logs, memories, commands, power switch."""

import errno
import json
import statistics
import struct
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from queue import Queue
from typing import Any

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import MemoryElement
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.utils.power_switch import PowerSwitch

from onboard.app_interface import INTERFACE_VERSION
from tests.patience import PATIENCE_S
from tests.sim_crazyflie.minimal_firmware import MinimalFirmware, RawClient, ServedFirmware, serve

DEADLINE_S = PATIENCE_S


@pytest.fixture(scope="module", autouse=True)
def _drivers() -> None:
    cflib.crtp.init_drivers()


@pytest.fixture(scope="class")
def drone() -> Iterator[ServedFirmware]:
    with serve(MinimalFirmware()) as served:
        yield served


@pytest.fixture(scope="class")
def crazyflie(drone: ServedFirmware) -> Iterator[Crazyflie]:
    with SyncCrazyflie(drone.uri, cf=Crazyflie()) as link:
        wait(link.is_params_updated, "parameters")
        yield link.cf


def wait(condition: Callable[[], bool], what: str) -> None:
    """Wait until a condition of cflib holds that has no event of its own."""
    deadline = time.monotonic() + DEADLINE_S
    tick = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, f"no {what} within {DEADLINE_S} s"
        tick.wait(0.002)


def connect(uri: str, cache: Path | None = None) -> Crazyflie:
    """A fully connected Crazyflie."""
    cf = Crazyflie(rw_cache=str(cache) if cache else None)
    done = threading.Event()
    cf.fully_connected.add_callback(lambda _uri: done.set())
    cf.open_link(uri)
    assert done.wait(DEADLINE_S), "never fully connected"
    return cf


def test_fully_connects_without_a_cache_and_from_it(drone: ServedFirmware, tmp_path: Path) -> None:
    for _ in range(2):
        connect(drone.uri, tmp_path).close_link()
    names = sorted(path.stem for path in tmp_path.iterdir())
    assert names == sorted(f"{table.crc:08X}" for table in (drone.firmware.logs, drone.firmware.params))


def test_tables_and_values_are_those_of_the_real_drone(crazyflie: Crazyflie, shared_data: Path) -> None:
    dump = json.loads((shared_data / "crazyflie" / "toc_cf2_2026.08.json").read_text())
    logs, params = crazyflie.log.toc.toc, crazyflie.param.toc.toc
    for item in dump["log"]["items"]:
        entry = logs[item["group"]][item["name"]]
        assert (entry.ident, entry.ctype) == (item["id"], LOG_TYPES[item["type"] & 0x0F]), item
    for item in dump["param"]["items"]:
        entry = params[item["group"]][item["name"]]
        assert entry.ident == item["id"]
        assert (entry.access == entry.RO_ACCESS) == item["readonly"], item
        assert entry.is_persistent() == item["persistent"], item
        value = crazyflie.param.values[item["group"]][item["name"]]
        if (item["group"], item["name"]) != ("system", "selftestPassed"):
            assert float(value) == pytest.approx(item["default"], rel=1e-6), item


LOG_TYPES = dict(
    enumerate(["", "uint8_t", "uint16_t", "uint32_t", "int8_t", "int16_t", "int32_t", "float", "FP16"])
)


def test_app_is_in_the_tables(crazyflie: Crazyflie) -> None:
    assert crazyflie.param.get_value("perch.version") == str(INTERFACE_VERSION)
    assert crazyflie.log.toc.get_element_by_complete_name("perchT.trigVal").ctype == "float"


def test_platform_and_console(drone: ServedFirmware) -> None:
    text: Queue[str] = Queue()
    cf = Crazyflie()
    cf.console.receivedChar.add_callback(text.put)
    link = SyncCrazyflie(drone.uri, cf=cf)
    with link:
        assert cf.platform.get_protocol_version() == 12
        received = ""
        while received.count("\n") < 2:
            received += text.get(timeout=DEADLINE_S)
    assert received.startswith("SYS: Crazyflie 2.1 is up and running!\n")


class TestParameters:
    def test_set_and_value_updates(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        changes: Queue[tuple[str, str]] = Queue()
        crazyflie.param.add_update_callback("ring", "effect", lambda name, value: changes.put((name, value)))
        crazyflie.param.add_update_callback("perch", "vx", lambda name, value: changes.put((name, value)))
        crazyflie.param.set_value("ring.effect", 9)
        assert changes.get(timeout=DEADLINE_S) == ("ring.effect", "9")
        assert drone.firmware.params["ring.effect"] == 9
        crazyflie.param.set_value("perch.vx", 2.5)
        assert changes.get(timeout=DEADLINE_S) == ("perch.vx", "2.5")

        def change() -> None:
            drone.firmware.params["ring.effect"] = 3

        drone.call(change)
        assert changes.get(timeout=DEADLINE_S) == ("ring.effect", "3")
        assert crazyflie.param.get_value("ring.effect") == "3"

    def test_read_only_is_refused_by_cflib_already(self, crazyflie: Crazyflie) -> None:
        with pytest.raises(AttributeError):
            crazyflie.param.set_value("perch.polStat", 1)

    def test_persistent_store_state_clear_over_a_reboot(
        self, crazyflie: Crazyflie, drone: ServedFirmware
    ) -> None:
        def ask(function: Callable[..., Any]) -> Any:
            answers: Queue[Any] = Queue()
            function("ring.effect", lambda _name, answer: answers.put(answer))
            return answers.get(timeout=DEADLINE_S)

        param = crazyflie.param
        state = ask(param.persistent_get_state)
        assert (state.is_stored, state.default_value, state.stored_value) == (False, 6, None)
        set_and_wait(crazyflie, "ring.effect", 10)
        assert ask(param.persistent_store) is True
        state = ask(param.persistent_get_state)
        assert (state.is_stored, state.default_value, state.stored_value) == (True, 6, 10)
        drone.call(drone.firmware.reboot)
        assert drone.firmware.params["ring.effect"] == 10
        assert ask(param.persistent_clear) is True
        assert ask(param.persistent_get_state).is_stored is False
        assert ask(param.get_default_value) == 6


def set_and_wait(cf: Crazyflie, name: str, value: float) -> None:
    """Set a parameter and wait for its echo."""
    group, short = name.split(".")
    echoed = threading.Event()
    cf.param.add_update_callback(group, short, lambda *_: echoed.set())
    echoed.clear()
    cf.param.set_value(name, value)
    assert echoed.wait(DEADLINE_S)
    wait(lambda: float(cf.param.get_value(name)) == value, f"{name} = {value}")


class TestLog:
    def test_rate_values_and_types(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        logs = drone.firmware.logs
        drone.call(lambda: logs.bind("stateEstimate.x", lambda: -1.25))
        drone.call(lambda: logs.bind("motor.m1", lambda: 40000))
        drone.call(lambda: logs.bind("stateEstimateZ.x", lambda: -1250))
        drone.call(lambda: logs.bind("pm.vbat", lambda: 3.7001953125))
        config = LogConfig("test", period_in_ms=10)
        config.add_variable("stateEstimate.x")
        config.add_variable("motor.m1", "uint16_t")
        config.add_variable("stateEstimateZ.x", "int16_t")
        config.add_variable("pm.vbat", "FP16")
        config.add_variable("supervisor.info", "uint16_t")
        samples: Queue[tuple[int, dict[str, float]]] = Queue()
        crazyflie.log.add_config(config)
        config.data_received_cb.add_callback(lambda stamp, values, _config: samples.put((stamp, values)))
        config.start()
        received = [samples.get(timeout=DEADLINE_S) for _ in range(50)]
        config.delete()
        wait(lambda: not config.added, "deletion")
        periods = [after - before for (before, _), (after, _) in pairwise(received)]
        assert statistics.median(periods) == pytest.approx(10, abs=1)
        assert received[-1][1] == {
            "stateEstimate.x": -1.25,
            "motor.m1": 40000,
            "stateEstimateZ.x": -1250,
            "pm.vbat": 3.701171875,  # 3.7001953125 with the firmware's rounding
            "supervisor.info": 1,
        }

    def test_many_blocks(self, crazyflie: Crazyflie) -> None:
        names = [f"stateEstimate.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz")]
        counts = [0] * 16
        enough = threading.Event()

        def count(index: int) -> None:
            counts[index] += 1
            if min(counts) >= 20:
                enough.set()

        configs = []
        for index in range(16):
            config = LogConfig(f"block {index}", period_in_ms=10)
            for name in names:
                config.add_variable(name)
            crazyflie.log.add_config(config)
            config.data_received_cb.add_callback(lambda _stamp, _values, _config, index=index: count(index))
            configs.append(config)
        for config in configs:
            config.start()
        assert enough.wait(DEADLINE_S), counts


class TestMemory:
    def test_memories(self, crazyflie: Crazyflie) -> None:
        assert [mem.type for mem in crazyflie.mem.mems] == [0x00, 0x18, 0x12, 0x15, 0x19]

    def test_tester_is_verified_on_the_drone(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        (tester,) = crazyflie.mem.get_mems(MemoryElement.TYPE_MEMORY_TESTER)
        done: Queue[Any] = Queue()
        tester.write_data(5, 1000, lambda *_: done.put("written"))
        assert done.get(timeout=DEADLINE_S) == "written"
        assert drone.firmware.tester.write_errors == 0
        tester.read_data(5, 1000, lambda _mem: done.put("read"))
        assert done.get(timeout=DEADLINE_S) == "read"
        assert tester.readValidationSuccess

    def test_app_memory_written_and_read_back(self, crazyflie: Crazyflie) -> None:
        (app,) = crazyflie.mem.get_mems(0x18)
        data = bytes((7 * i + i // 256) % 256 for i in range(5120))
        done: Queue[bytes] = Queue()
        crazyflie.mem.mem_write_cb.add_callback(lambda _mem, _addr: done.put(b""))
        crazyflie.mem.mem_read_cb.add_callback(lambda _mem, _addr, read: done.put(bytes(read)))
        crazyflie.mem.write(app, 0, list(data), flush_queue=True)
        assert done.get(timeout=DEADLINE_S) == b""
        assert crazyflie.mem.read(app, 0, len(data))
        assert done.get(timeout=DEADLINE_S) == data

    def test_refused_write_fails(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        (app,) = crazyflie.mem.get_mems(0x18)
        failed = threading.Event()
        crazyflie.mem.mem_write_failed_cb.add_callback(lambda _mem, _addr: failed.set())
        drone.firmware.flying = True
        before = bytes(drone.firmware.app_memory.data)
        crazyflie.mem.write(app, 0, list(range(100)), flush_queue=True)
        assert failed.wait(DEADLINE_S)
        drone.firmware.flying = False
        assert bytes(drone.firmware.app_memory.data) == before


class TestFlightCommands:
    def test_commands_arrive_with_the_firmwares_lengths(
        self, crazyflie: Crazyflie, drone: ServedFirmware
    ) -> None:
        errors: Queue[tuple[int, int]] = Queue()
        crazyflie.add_port_callback(8, lambda packet: errors.put((packet.data[0], packet.data[3])))
        commander = crazyflie.high_level_commander
        commander.takeoff(0.5, 2.0)
        commander.go_to(0, 0, 1, 0, 2.0)
        commander.land(0.0, 2.0)
        commander.spiral(1.0, 0.5, 0.5, 0.1, 2.0)
        commander.start_trajectory(1)
        commander.define_trajectory(1, 0, 3)
        commander.stop()
        answers = [errors.get(timeout=DEADLINE_S) for _ in range(7)]
        assert answers == [(command, errno.EBUSY) for command in (7, 12, 8, 11, 13, 6, 3)]
        setpoints = crazyflie.commander
        setpoints.send_setpoint(0, 0, 0, 0)
        setpoints.send_position_setpoint(0, 0, 1, 0)
        setpoints.send_velocity_world_setpoint(0, 0, 0, 0)
        setpoints.send_zdistance_setpoint(0, 0, 0, 0.4)
        setpoints.send_hover_setpoint(0, 0, 0, 0.4)
        setpoints.send_full_state_setpoint([0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0, 1], 0, 0, 0)
        setpoints.send_setpoint_manual(0, 0, 0, 0, False)
        setpoints.send_stop_setpoint()
        setpoints.send_notify_setpoint_stop(100)
        wait(lambda: ("notify", 100) in drone.firmware.calls, "notify stop")
        types = [call[1][0] for call in drone.firmware.calls if call[0] == "generic"]
        assert types == [7, 8, 9, 10, 6, 11, 0]
        assert drone.server.assertions == []

    def test_external_pose(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        drone.firmware.calls.clear()
        crazyflie.extpos.send_extpos(1.0, 2.0, 3.0)
        crazyflie.extpos.send_extpose(1.0, 2.0, 3.0, 0.0, 0.0, 0.5, 0.75)
        wait(lambda: len(drone.firmware.calls) >= 2, "poses")
        assert drone.firmware.calls == [
            ("position", 1.0, 2.0, 3.0),
            ("pose", 1.0, 2.0, 3.0, 0.0, 0.0, 0.5, 0.75),
        ]

    def test_supervisor(self, crazyflie: Crazyflie, drone: ServedFirmware) -> None:
        assert crazyflie.supervisor.can_be_armed
        assert not crazyflie.supervisor.is_armed
        crazyflie.supervisor.send_arming_request(True)
        wait(lambda: drone.firmware.armed, "arming")
        crazyflie.supervisor.send_emergency_stop_watchdog()
        crazyflie.supervisor.send_emergency_stop()
        wait(lambda: drone.firmware.stopped, "emergency stop")
        assert ("watchdog",) in drone.firmware.calls


def test_power_switch(drone: ServedFirmware) -> None:
    switch = PowerSwitch(drone.uri)
    switch.stm_power_down()
    assert not drone.firmware.powered
    switch.stm_power_up()
    assert drone.firmware.powered
    switch.reboot_to_fw()
    switch.close()
    assert drone.firmware.boot_count == 3
    cf = connect(drone.uri)
    cf.close_link()


def test_reconnects_and_a_second_drone_beside_it(drone: ServedFirmware) -> None:
    link = SyncCrazyflie(drone.uri, cf=Crazyflie())
    for _ in range(2):
        with link:
            wait(link.is_params_updated, "parameters")
    with serve(MinimalFirmware()) as other, link:
        cf = connect(other.uri)
        assert cf.param.get_value("perch.version") == str(INTERFACE_VERSION)
        cf.close_link()


def test_without_our_app_the_crcs_are_the_firmwares() -> None:
    with serve(MinimalFirmware(with_app=False)) as drone, RawClient(drone.uri) as client:
        assert struct.unpack_from("<HI", client.ask(5, 0, b"\3")[0], 1) == (567, 0xC104357B)
        assert struct.unpack_from("<HI", client.ask(2, 0, b"\3")[0], 1) == (335, 0x15952A0F)
        cf = connect(drone.uri)
        cf.close_link()
