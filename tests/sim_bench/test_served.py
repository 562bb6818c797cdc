"""The bench as a process, with the link, the ports and the hands that a wizard uses."""

import asyncio
import json
import math
import os
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any, Self

import numpy as np
import pytest
import serial

from onboard.gravity import GRAVITY
from onboard.link import LogSample
from perchhw.cli.main import run
from perchhw.lab_process import LabNotReady, SimulatedLab
from sim_backend.bench.errors import BenchInputError
from sim_backend.bench.serve import BenchSettings, ServedBench
from sim_backend.faults import parse_faults
from tests.patience import PATIENCE_S, patient_link
from tests.sim_bench.benches import HANG_Z, vehicle

PACE = 3.0


class Assistant:
    """A client of the hands protocol."""

    def __init__(self, address: str) -> None:
        host, port = address.removeprefix("tcp://").split(":")
        self._socket = socket.create_connection((host, int(port)), PATIENCE_S)
        self._stream = self._socket.makefile("rwb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self._socket.close()

    def raw(self, line: bytes) -> dict[str, Any]:
        self._stream.write(line)
        self._stream.flush()
        reply: dict[str, Any] = json.loads(self._stream.readline())
        return reply

    def __call__(self, **request: Any) -> dict[str, Any]:
        return self.raw(json.dumps(request).encode() + b"\n")


class Collector:
    """Samples of a log stream until there are enough."""

    def __init__(self, enough: Callable[[LogSample], bool]) -> None:
        self.samples: list[LogSample] = []
        self.done = threading.Event()
        self._enough = enough

    def __call__(self, sample: LogSample) -> None:
        self.samples.append(sample)
        if self._enough(sample):
            self.done.set()


@pytest.fixture(scope="module")
def bench() -> Iterator[SimulatedLab]:
    with SimulatedLab("bench", ["--drone-port", "0", "--pace", str(PACE)]) as served:
        yield served


@pytest.fixture
def hands(bench: SimulatedLab) -> Iterator[Assistant]:
    with Assistant(bench.ready["bench"]["hands"]) as client:
        yield client


def test_ready_line(bench: SimulatedLab) -> None:
    assert bench.drones[0].startswith("udp://127.0.0.1:")
    assert bench.mocap == []
    assert set(bench.ready["bench"]) == {"tachometer", "scale", "supply", "balance", "korad", "hands"}
    assert bench.ready["pace"] == PACE
    assert all(os.path.exists(bench.ready["bench"][name]) for name in ("tachometer", "scale", "supply"))  # noqa: PTH110


def test_hands_answer_in_order_and_survive_nonsense(hands: Assistant) -> None:
    assert hands.raw(b"{]\n")["error"]
    assert hands.raw(b"[1, 2]\n")["error"]
    assert hands.raw(b"\xff\xfe\n")["error"]
    assert hands(ask="mass")["unit"] == "kg"
    assert "hang it first" in hands(do="twist", angle=0.1)["error"]


def test_a_line_without_an_end_is_told_and_hung_up(bench: SimulatedLab) -> None:
    with Assistant(bench.ready["bench"]["hands"]) as endless:
        assert "65536" in endless.raw(b"x" * 70_000)["error"]
    with Assistant(bench.ready["bench"]["hands"]) as hands:
        assert hands(ask="blades") == {"value": 2, "unit": "1"}


def test_hanging_drone_logs_its_pendulum_at_100_hz(bench: SimulatedLab, hands: Assistant) -> None:
    names = ["gyro.x", "gyro.y", "gyro.z", "acc.x", "acc.y", "acc.z"]
    hands(**HANG_Z)
    try:
        hands(do="damp")
        hands(do="twist", angle=0.15)
        with patient_link(bench.drones[0]) as link:
            collector = Collector(lambda _: len(collector.samples) >= 800)
            with link.stream(names, 10, collector):
                assert collector.done.wait(PATIENCE_S)
        distances = [hands(ask=f"string_distance_{end}")["value"] for end in ("top", "bottom")]
        length = hands(ask="string_length")["value"]
    finally:
        hands(do="take_down")
    times = np.array([sample.drone_time_ms for sample in collector.samples]) / 1000.0
    values = np.array([list(sample.values.values()) for sample in collector.samples])
    assert np.median(np.diff(times)) == pytest.approx(0.01)
    assert np.diff(times).min() > 0.0
    assert np.linalg.norm(values[:, 3:], axis=1).mean() == pytest.approx(1.0, rel=0.01)
    spin = np.radians(values[:, 2])
    assert 0.1 * 3.0 < np.abs(spin).max() < 0.25 * 3.0
    ups = np.flatnonzero((spin[:-1] < 0) & (spin[1:] >= 0))
    at = times[ups] - spin[ups] * (times[ups + 1] - times[ups]) / (spin[ups + 1] - spin[ups])
    at = at[np.append(True, np.diff(at) > 0.3)]  # noise near zero crosses more than once
    period = (at[-1] - at[0]) / (len(at) - 1)
    truth = vehicle().body
    inertia = (
        truth.mass.value * GRAVITY * distances[0] * distances[1] * period**2 / (16 * math.pi**2 * length)
    )
    assert inertia == pytest.approx(truth.inertia_zz.value, rel=0.02)


def test_motors_instruments_and_record_end_to_end(bench: SimulatedLab, hands: Assistant) -> None:
    ports = bench.ready["bench"]
    hands(do="clamp", motor=2)
    with (
        serial.Serial(ports["supply"], 9600, timeout=PATIENCE_S) as supply,
        serial.Serial(ports["tachometer"], 115200, timeout=PATIENCE_S) as tachometer,
        patient_link(bench.drones[0]) as link,
    ):
        supply.write(b"VOLT 4.0;CURR 8;OUTP ON;OUTP?\n")
        assert supply.readline() == b"1\n"
        tachometer.write(b"?S")
        while not tachometer.readline().startswith(b"I,1,tach"):
            pass
        link.set_param("motorPowerSet.m2", 120 * 256)
        link.set_param("motorPowerSet.enable", 1)
        lines = []
        while len(lines) < 300:
            line = tachometer.readline()
            lines += [line] if line.startswith(b"E") else []
        deltas = np.array([[int(d) for d in line.split(b"*")[0].split(b",")[3:]] for line in lines[-20:]])
        speed = 2 * math.pi / (2e-6 * np.median(deltas[:, :6].reshape(-1, 2).mean(axis=1)))
        supply.write(b"MEAS:CURR?\n")
        assert float(supply.readline()) > 0.3
        assert "turn" in hands(do="clamp", motor=1)["error"]
        link.set_param("motorPowerSet.enable", 0)
        link.set_param("motorPowerSet.m2", 0)
        spins = hands(ask="spin_record")["value"]["spins"]
        while spins[-1]["stopped"] is None:
            spins = hands(ask="spin_record")["value"]["spins"]
        supply.write(b"OUTP OFF;OUTP?\n")
        assert supply.readline() == b"0\n"
    assert 1000.0 < speed < 2500.0
    assert spins[-1]["place"] == "clamped"
    assert spins[-1]["stopped"] is not None
    assert hands(ask="spin_record")["value"]["incidents"] == []


def test_scale_and_replug(bench: SimulatedLab, hands: Assistant) -> None:
    def mean(device: str) -> float:
        with serial.Serial(device, 115200, timeout=PATIENCE_S) as scale:
            scale.write(b"S")
            lines: list[bytes] = []
            while len(lines) < 30:
                line = scale.readline()
                lines += [line] if line.startswith(b"L,") else []
        return float(np.mean([int(line.split(b"*")[0].split(b",")[3]) for line in lines[10:]]))

    device = bench.ready["bench"]["scale"]
    empty = mean(device)
    hands(do="put_weight", mass=0.05)
    loaded = mean(device)
    reply = hands(do="replug", instrument="scale")
    again = mean(reply["device"])
    hands(do="remove_weight")
    assert reply["device"] != device
    assert (loaded - empty) / 50.0 == pytest.approx(4200.0, rel=0.11)
    assert again == pytest.approx(loaded, abs=300.0)
    assert "scale" in hands(do="replug", instrument="kettle")["error"]


def test_a_second_bench_on_the_same_port_and_a_bad_pace_are_told(
    bench: SimulatedLab, capsys: pytest.CaptureFixture[str]
) -> None:
    port = bench.drones[0].rpartition(":")[2]
    with pytest.raises(LabNotReady, match=f"{port} on .* is in use by another program"):
        SimulatedLab("bench", ["--drone-port", port]).open()
    assert run(["sim", "bench", "--drone-port", "0", "--pace", "900"]) == 2
    assert "pace" in capsys.readouterr().err


class Fixture:
    """A served bench in this process, under a clock that stands until it is moved."""

    def __init__(self, *faults: str, pace: float = 1.0) -> None:
        self.now = 100.0
        self.served = ServedBench(
            BenchSettings(pace=pace, faults=parse_faults(faults)), clock=lambda: self.now
        )
        self.served.prepare()

    async def start(self) -> None:
        await self.served.start()
        self.served._started = self.now

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            self.served.round()


def test_pace_and_link_loss_and_unplugging_in_bench_time() -> None:
    async def check() -> None:
        made = Fixture(
            "bench_link_loss=1.0:0.5", "bench_unplug=tachometer:2.0", "bench_wrong_device=1", pace=4.0
        )
        await made.start()
        served = made.served
        try:
            made.run(0.2)
            assert served.bench.time == pytest.approx(0.8, abs=0.05)
            assert served._link.loss == 0.0
            made.run(0.1)
            assert served._link.loss == 1.0
            made.run(0.1)
            assert served._link.loss == 0.0
            tachometer = served.ready()["bench"]["tachometer"]
            with serial.Serial(tachometer, 115200, timeout=0.05) as port:
                port.write(b"?")
                received = b""
                while b"I,1,load" not in received:  # the ports are mixed up
                    assert served.bench.time < 1.9
                    made.run(0.01)
                    received += port.read(1000)
                made.run(0.2)
                with pytest.raises(serial.SerialException):
                    port.read(1)
        finally:
            await served.close()

    asyncio.run(check())


def test_replies_wait_for_bench_time_and_lag_is_given_up() -> None:
    async def check() -> None:
        made = Fixture()
        await made.start()
        served = made.served
        try:
            # Somebody else waits until the end: closing does not wait with them.
            reader, writer = await asyncio.open_connection(*served.assistant.address[6:].split(":"))
            writer.write(json.dumps(HANG_Z).encode() + b"\n" + b'{"do": "damp"}\n')
            assert json.loads(await reader.readline()) == {"done": True}
            waiting = asyncio.ensure_future(served.wait_until(0.5))
            await asyncio.sleep(0)
            made.run(0.4)
            await asyncio.sleep(0)
            assert not waiting.done()
            made.run(0.2)
            await waiting
            writer.close()
            made.now += 5.0
            served.round()
            assert served.dropped == pytest.approx(4.8, abs=0.05)
        finally:
            await served.close()

    asyncio.run(check())


@pytest.mark.parametrize("pace", [0.0, -1.0, math.nan, 51.0])
def test_pace_must_be_possible(pace: float) -> None:
    with pytest.raises(BenchInputError, match="pace"):
        ServedBench(BenchSettings(pace=pace))
