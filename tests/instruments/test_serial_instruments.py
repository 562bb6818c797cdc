"""Tachometer and load cell on pseudo-terminals: handshake, losses, restarts, unplugging, wrong devices."""

import dataclasses
import threading
from collections.abc import Sequence

import numpy as np
import pytest

from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentLost,
    InstrumentNotFound,
    InstrumentTimeout,
    ScaleUnusable,
    WrongBaudRate,
    WrongDevice,
)
from calibration.bench.instruments.load_cell import LoadCell, check_counts
from calibration.bench.instruments.protocol import Fault
from calibration.bench.instruments.reader import Reconnect
from calibration.bench.instruments.scale import ScaleCalibration, ScaleReading
from calibration.bench.instruments.tachometer import Tachometer, TachometerBatch
from calibration.bench.instruments.transport import Address, SerialPort
from tests.instruments.pty_device import LineBoard, PtyDevice, framed
from tests.patience import until


def joined(batches: Sequence[TachometerBatch]) -> TachometerBatch:
    """One batch of several of one epoch, with what these tests read of it."""
    assert len({batch.epoch for batch in batches}) == 1
    return dataclasses.replace(
        batches[-1],
        edges=np.concatenate([batch.edges for batch in batches]),
        beat_times=np.concatenate([batch.beat_times for batch in batches]),
        lost_lines=sum(batch.lost_lines for batch in batches),
    )


def collect(tachometer: Tachometer, edges: int) -> TachometerBatch:
    """Take until so many edges have come."""
    batches = [tachometer.take()]
    while sum(batch.edges.size for batch in batches) < edges:
        batch = tachometer.take()
        assert batch.edges.size or batch.beat_times.size, "nothing comes"
        batches.append(batch)
    return joined(batches)


def take_for_ever(tachometer: Tachometer) -> None:
    while True:
        tachometer.take()


def started(board: LineBoard, reconnect: Reconnect | None = None) -> Tachometer:
    tachometer = Tachometer(board.name, reconnect=reconnect)
    tachometer.start()
    board.await_received(b"S\n")
    return tachometer


@pytest.mark.parametrize("silent_for", [0, 2])
def test_edges_marks_and_heartbeats_arrive_with_their_times(silent_for: int) -> None:
    """Also from a board that resets when its port opens and does not hear the first questions."""
    with LineBoard(silent_for=silent_for) as board, started(board) as tachometer:
        board.send(
            board.beat(), board.edges([1_000] * 8), board.edges([1_200] * 3), board.beat(), end=b"\r\n"
        )
        batch = collect(tachometer, 11)
        assert batch.edges == pytest.approx(1.1 + np.cumsum([1e-3] * 8 + [1.2e-3] * 3))
        assert batch.beat_times == pytest.approx([1.1, 1.2116])
        assert batch.alive
        assert tachometer.mark("up").time == pytest.approx(1.2126)
        assert [mark.tag for mark in tachometer.take().marks] == ["up"]
        assert tachometer.report.link.clean


def test_the_edge_count_of_the_device_proves_that_an_edge_was_lost() -> None:
    with LineBoard() as board, started(board) as tachometer:
        tachometer._run = (0.0, float("inf"))  # started long ago
        board.send(
            board.beat(), board.edges([1_000] * 8), board.beat(), board.edges([1_000] * 8), board.beat()
        )
        collect(tachometer, 16)
        board.total += 3  # the device has seen three that it never sent
        board.send(*(board.beat() for _ in range(12)), board.edges([1_000] * 8))
        collect(tachometer, 8)
        assert (tachometer.report.lost_edges, tachometer.report.link.lost) == (3, 0)


def test_faults_on_the_line_are_counted_and_nothing_wrong_is_taken() -> None:
    with LineBoard() as board, started(board) as tachometer:
        first, flipped, merged_a, merged_b, last = (board.edges([1_000] * 8) for _ in range(5))
        bad = flipped.replace(b",1000", b",1001", 1)
        board.send_raw(first + b"\n" + bad + b"\n" + merged_a + merged_b + b"\n\xff\0\xff\n" + last[:20])
        board.send_raw(last[20:] + b"\n" + board.beat() + b"\n")
        batch = collect(tachometer, 16)
        assert np.diff(batch.edges)[:7] == pytest.approx(1e-3)
        assert batch.lost_lines == 3
        assert tachometer.report.link.faults == {Fault.CHECKSUM: 1, Fault.MERGED: 1, Fault.GARBAGE: 1}
        assert tachometer.report.link.lost == 3


def test_a_restart_begins_a_new_epoch_and_is_started_again() -> None:
    with LineBoard() as board, started(board) as tachometer:
        board.send(board.beat(), board.edges([1_000] * 4))
        before = collect(tachometer, 4)
        board.received = b""
        board.send(board.restart())
        board.await_received(b"S\n")
        board.send(board.beat(), board.edges([1_000] * 4), board.beat())
        after = collect(tachometer, 4)
        assert (before.epoch, after.epoch, tachometer.report.link.restarts) == (0, 1, 1)
        assert after.edges[0] == pytest.approx(0.106)


def test_unplugging_is_an_error_by_name_within_a_second() -> None:
    with LineBoard() as board, started(board) as tachometer:
        board.send(board.beat())
        assert tachometer.take().alive
        board.unplug()
        with pytest.raises(InstrumentLost, match=r"is gone .*unplugged"):
            take_for_ever(tachometer)
        with pytest.raises(InstrumentLost):
            tachometer.check()


def test_it_comes_back_under_another_name() -> None:
    with LineBoard() as first, LineBoard(uid="t2") as second:
        asked: list[str] = []

        def replugged(loss: InstrumentLost) -> str | None:
            asked.append(str(loss))
            return "/dev/does-not-exist" if len(asked) == 1 else second.name

        with started(first, replugged) as tachometer:
            first.send(first.beat(), first.edges([1_000] * 4), first.beat())
            collect(tachometer, 4)
            first.unplug()
            second.await_received(b"?")
            second.await_received(b"S\n")
            second.send(second.restart(), second.beat(), second.edges([1_000] * 4), second.beat())
            after = tachometer.take()
            while after.epoch == 0 or not after.edges.size:
                after = tachometer.take()
            assert (tachometer.device, tachometer.banner.uid) == (second.name, "t2")
            assert tachometer.report.link.reopened == 1
            assert len(asked) == 2
            assert "no port /dev/does-not-exist" in asked[1]


def test_a_dead_link_is_not_a_stopped_motor() -> None:
    """Time is injected: heartbeats without edges are life, a second without a heartbeat is not."""
    now = [100.0]
    with LineBoard() as board, Tachometer(board.name, clock=lambda: now[0]) as tachometer:
        board.send(board.beat())
        assert tachometer.take().alive
        now[0] += 0.9
        assert not tachometer.take(0.0).alive
        tachometer.check()
        now[0] += 0.2
        with pytest.raises(InstrumentLost, match=r"no heartbeat for 1\.1 s"):
            tachometer.take(0.0)
        with pytest.raises(InstrumentLost):
            tachometer.check()


def test_a_mark_without_echo_is_an_error() -> None:
    with LineBoard() as board, Tachometer(f"{board.name}?answer_s=0.1") as tachometer:
        board._answer = lambda _data: b""
        with pytest.raises(InstrumentTimeout, match=r"'up' was not echoed within 0\.1 s"):
            tachometer.mark("up")
        with pytest.raises(InstrumentInputError, match="is no mark"):
            tachometer.mark("two words")


@pytest.mark.further
def test_wrong_devices_are_named() -> None:
    legacy = b"".join(b"%d, 1034.72\r\n" % (1000 + 51 * i) for i in range(5))
    noise = np.random.default_rng(1).bytes(300)
    nmea = b"$GPGGA,1,2*33\r\n" * 3
    cases: list[tuple[bytes, type[InstrumentError], str]] = [
        (b"", InstrumentTimeout, "silent"),
        (noise, WrongBaudRate, "no text at 115200 baud"),
        (legacy, WrongDevice, "window-averaging"),
        (nmea, WrongDevice, r"it sends '\$GPGGA"),
        (framed("I,1,load,1.0,cell,4") + b"\n", WrongDevice, "load cell cell, not a tachometer"),
    ]
    for answer, error, words in cases:
        with PtyDevice(lambda _data, answer=answer: answer) as device:  # type: ignore[misc]
            with pytest.raises(error, match=words):
                Tachometer(device.name, handshake_s=1.0)
            with SerialPort(Address(device.name, 115200)):
                pass  # the failed attempt has let go of the port


def test_ports_that_cannot_be_opened_are_named() -> None:
    with pytest.raises(InstrumentNotFound, match="there is no port /dev/none"):
        Tachometer("/dev/none")
    with LineBoard() as board, Tachometer(board.name), pytest.raises(InstrumentNotFound, match="in use"):
        Tachometer(board.name)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("serial:///dev/ttyACM0?baud=9600", Address("/dev/ttyACM0", 9600)),
        ("serial:///dev/ttyACM0", Address("/dev/ttyACM0", 115200)),
        ("/dev/pts/3", Address("/dev/pts/3", 115200)),
        ("COM3", Address("COM3", 115200)),
        ("serial://COM3?baud=57600", Address("COM3", 57600)),
        ("serial://COM3?baud=57600&answer_s=2.5", Address("COM3", 57600, 2.5)),
        ("/dev/pts/3?answer_s=60", Address("/dev/pts/3", 115200, 60.0)),
    ],
)
def test_addresses(text: str, address: Address) -> None:
    assert Address.parse(text, 115200) == address


@pytest.mark.parametrize(
    "text",
    [
        "",
        "tcp://host:1",
        "serial://",
        "serial:///dev/x?baud=fast",
        "serial:///dev/x?baud=0",
        "serial:///d?b=1",
        "/dev/x?answer_s=soon",
        "/dev/x?answer_s=0",
        "/dev/x?answer_s=61",
        "/dev/x?answer_s=nan",
    ],
)
def test_bad_addresses_are_refused(text: str) -> None:
    with pytest.raises(InstrumentInputError):
        Address.parse(text, 115200)


# Load cell


def test_a_load_cell_is_calibrated_and_read() -> None:
    with LineBoard("load") as board:
        feeder = Feeder(board, 1_000)
        with feeder, LoadCell(board.name) as cell:
            raws = []
            for load in (1_000, 43_000, 106_000):
                feeder.counts = load
                cell.look(1.0)
                raws.append(shown(cell, 16).indication)
            calibration = ScaleCalibration.fit([0.0, 0.02, 0.05], raws, cell.least_span)
            assert calibration.per_kg == pytest.approx(2.1e6, rel=1e-3)
            feeder.counts = 22_000
            cell.look(1.0)
            reading = shown(cell, 80)
            assert calibration.mass(reading.indication) == pytest.approx(0.010, abs=2e-5)
            assert [finding.code for finding in reading.findings] in ([], ["scale_rate"])


def test_a_load_cell_that_gives_nothing_or_restarts_is_no_scale() -> None:
    with LineBoard("load") as board, LoadCell(board.name) as cell:
        cell.begin()
        board.send(board.line("X", 1, "hx711 not ready"))
        until(lambda: cell.look(0.1) or cell.report.events)
        with pytest.raises(ScaleUnusable, match=r"no reading.*hx711 not ready"):
            cell.read()
        board.send(*(board.line("L", 1_000 + k) for k in range(4)))
        board.send(board.restart())
        board.send(*(board.line("L", 1_000 + k) for k in range(4)))
        until(lambda: cell.look(0.1) or cell.report.restarts)
        with pytest.raises(ScaleUnusable, match="restarted"):
            cell.read()


def shown(cell: LoadCell, conversions: int) -> ScaleReading:
    """What it shows over that many conversions."""
    cell.begin()
    until(lambda: cell.look(1.0) or sum(batch.raw.size for batch in cell._seen) >= conversions)
    return cell.read()


class Feeder:
    """Sends conversions near `counts` until it is left."""

    def __init__(self, board: LineBoard, counts: int) -> None:
        self.counts = counts
        self._board = board
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        rng = np.random.default_rng(3)
        while not self._ended.wait(0.0125):
            self._board.ticks += 12_500
            self._board.send(self._board.line("L", self.counts + int(rng.integers(-20, 21))))


TIMES = np.arange(40) / 80.0


@pytest.mark.parametrize(
    ("times", "raw", "code"),
    [
        (TIMES[:0], np.empty(0, dtype=np.int64), "no_counts"),
        (TIMES, np.full(40, 8388607), "saturated"),
        (TIMES, np.r_[np.arange(39), -8388608], "saturated"),
        (TIMES, np.full(40, 1234), "stuck"),
        (TIMES, np.full(40, -1), "powered_down"),
        (TIMES, np.zeros(40, dtype=np.int64), "powered_down"),
        (3.0 * TIMES, np.arange(40), "scale_rate"),
    ],
)
def test_bad_counts_are_named(times: np.ndarray, raw: np.ndarray, code: str) -> None:
    assert [finding.code for finding in check_counts(times, raw)] == [code]


@pytest.mark.parametrize("rate", [10.0, 80.0, 86.0])
def test_good_counts_have_no_findings(rate: float) -> None:
    raw = np.random.default_rng(1).integers(-30, 30, 60)
    assert check_counts(np.arange(60) / rate, raw) == ()


@pytest.mark.parametrize("masses", [[0.0], [0.02, 0.02], [0.0, float("nan")]])
def test_a_calibration_that_cannot_be_is_refused(masses: list[float]) -> None:
    with pytest.raises(InstrumentInputError):
        ScaleCalibration.fit(masses, [1e3 * i for i in range(len(masses))], 100.0)
    with pytest.raises(InstrumentInputError, match="is the load cell wired"):
        ScaleCalibration.fit([0.0, 0.05], [500.0, 510.0], 100.0)


def test_a_calibration_says_how_straight_it_is() -> None:
    calibration = ScaleCalibration.fit([0.0, 0.02, 0.05], [0.0, -42_000.0, -105_300.0], 100.0)
    assert calibration.per_kg < 0.0  # mounted the other way round
    assert 1e-5 < calibration.nonlinearity < 1e-4
