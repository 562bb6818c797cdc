"""Records that were damaged: every damage is our error, or is told; nothing comes out silently wrong."""

import contextlib
import json
import random
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader

from calibration.flights import open_flight
from calibration.flights.flight import UnusableFlightError
from onboard.record.checksum import with_checksum
from onboard.record.run_record import RunFolderError, RunRecord
from perchhw.cli.main import run
from perchhw.record import TOPICS, RunRecorder
from perchhw.record.run import read_run
from tests.drawn_examples import examples

FILES = ("run.json", "series.mcap", "events.jsonl")
MORE = settings(
    max_examples=examples(250), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def write(folder: Path, *, close: bool) -> Path:
    """A small flight with every topic and every kind of value."""
    rng = random.Random(5)
    recorder = RunRecorder(folder, {"ceiling_z": 2.1, "speed_m_s": 2.5, "vehicle": "crazyflie21-upgraded"})
    for step in range(12):
        for topic in TOPICS.values():
            values = {f.name: "ok" if f.is_text else rng.gauss(0.0, 1.0) for f in topic.fields}
            if step == 3:
                values |= {f.name: None for f in topic.fields[:1]}
            if step == 4:
                values |= {f.name: float("-inf") for f in topic.fields[:1]}
            recorder.write(topic.name, 10.0 + 0.01 * step, values)
        recorder.event("phase", 10.0 + 0.01 * step, phase="hover")
    if close:
        recorder.close(outcome="four_legs")
    else:
        recorder._stream.close()
        recorder._events.close()
    return folder


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("closed") / "run", close=True)


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("killed") / "run", close=False)


def copy(original: Path, folder: Path, changed: str, change: Callable[[bytearray], object]) -> Path:
    folder.mkdir(exist_ok=True)
    for name in FILES:
        data = bytearray((original / name).read_bytes())
        if name == changed:
            change(data)
        (folder / name).write_bytes(data)
    return folder


def read(folder: Path) -> RunRecord | None:
    """The record, or None when it was refused by an error that names a file in it and what to do.

    What can be made of a record is made of it: a damage must not come to light later.
    """
    refusal = ""
    try:
        record = read_run(folder)
    except RunFolderError as error:
        refusal = str(error)
    if refusal:
        assert str(folder) in refusal
        assert any(remedy in refusal for remedy in ("fetch it again", "not a run of perchhw", "unchunked"))
        return None
    for series in record.series.values():
        for name in series.fields():
            assert series.numbers(name).shape == series.t.shape
    with contextlib.suppress(UnusableFlightError):
        open_flight(folder)
    return record


def crc_says_damaged(path: Path) -> bool:
    """Whether the library itself finds a wrong checksum."""
    with path.open("rb") as stream:
        try:
            for _ in StreamReader(stream, validate_crcs=True, record_size_limit=1 << 20).records:
                pass
        except (McapError, struct.error, ValueError):
            return True
    return False


def same(one: RunRecord, other: RunRecord) -> bool:
    return one.series.keys() == other.series.keys() and all(
        np.array_equal(one.series[name].t, other.series[name].t)
        and repr(one.series[name].messages) == repr(other.series[name].messages)
        for name in one.series
    )


flips = st.lists(
    st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=4
)


@MORE
@given(flips=flips)
@example(flips=[(0.999999, 1)])
@pytest.mark.further
def test_a_closed_record_is_refused_or_right(
    closed: Path, tmp_path: Path, flips: list[tuple[float, int]]
) -> None:
    def flip(data: bytearray) -> None:
        for share, mask in flips:
            data[int(share * len(data))] ^= mask

    folder = copy(closed, tmp_path / "run", "series.mcap", flip)
    record = read(folder)
    if record is not None:
        assert same(record, read_run(closed)), "a wrong silent success"
        assert bool(record.torn) or not crc_says_damaged(folder / "series.mcap")


def test_what_is_not_damaged_is_not_called_so(closed: Path, killed: Path, tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "empty", {}):
        pass
    for folder in (closed, tmp_path / "empty"):
        assert read_run(folder).torn == ()
        assert not crc_says_damaged(folder / "series.mcap")
    assert same(read_run(killed), read_run(closed))


@pytest.mark.further
def test_every_single_bit_of_a_closed_record(closed: Path, tmp_path: Path) -> None:
    whole = read_run(closed)
    data = (closed / "series.mcap").read_bytes()
    folder = copy(closed, tmp_path / "run", "", lambda data: None)
    rng = random.Random(8)
    for place in sorted(rng.sample(range(len(data)), 300)) + list(range(len(data) - 60, len(data))):
        damaged = bytearray(data)
        damaged[place] ^= 1 << rng.randrange(8)
        (folder / "series.mcap").write_bytes(damaged)
        record = read(folder)
        assert record is None or (record.torn and same(record, whole)), place


@MORE
@given(share=st.floats(0.0, 1.0), flips=flips)
def test_a_record_of_a_killed_writer_gives_our_errors_and_no_others(
    killed: Path, tmp_path: Path, share: float, flips: list[tuple[float, int]]
) -> None:
    def damage(data: bytearray) -> None:
        for place, mask in flips:
            data[int(place * len(data))] ^= mask
        del data[int(share * len(data)) :]

    record = read(copy(killed, tmp_path / "run", "series.mcap", damage))
    assert record is None or record.torn


@MORE
@given(name=st.sampled_from(["run.json", "events.jsonl"]), share=st.floats(0.0, 1.0), flips=flips)
def test_damaged_words_give_our_errors_and_no_others(
    closed: Path, tmp_path: Path, name: str, share: float, flips: list[tuple[float, int]]
) -> None:
    def damage(data: bytearray) -> None:
        for place, mask in flips:
            data[int(place * len(data))] ^= mask
        del data[int(share * len(data)) or len(data) :]

    read(copy(closed, tmp_path / "run", name, damage))


@pytest.mark.parametrize("name", ["run.json", "events.jsonl"])
def test_every_single_bit_of_the_words(closed: Path, tmp_path: Path, name: str) -> None:
    """A wrong bit is refused, or is in what says no word of the run: spaces, and the name of a checksum."""
    whole = read_run(closed)
    data = (closed / name).read_bytes()
    folder = copy(closed, tmp_path / "run", "", lambda data: None)
    refused = 0
    for place in range(len(data)):
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8
        (folder / name).write_bytes(damaged)
        try:
            record = read_run(folder)
        except RunFolderError:
            refused += 1
            continue
        assert record.torn or holds(record, whole), place
    assert refused > 0.9 * len(data.replace(b" ", b""))


def holds(record: RunRecord, whole: RunRecord) -> bool:
    """Whether it says all that was said, and at most the checksum under another name."""
    pairs = [(record.info, whole.info), *zip(record.events, whole.events, strict=True)]
    return all(mine.get(key) == value for mine, theirs in pairs for key, value in theirs.items())


def test_a_record_of_an_earlier_version_has_no_crc_and_is_read(closed: Path, tmp_path: Path) -> None:
    def without(data: bytearray) -> None:
        position = 8
        while data[position] != 0x0F:
            position += 9 + int.from_bytes(data[position + 1 : position + 9], "little")
        data[position + 9 : position + 13] = bytes(4)

    record = read_run(copy(closed, tmp_path / "run", "series.mcap", without))
    assert record.torn == ()
    assert same(record, read_run(closed))


@pytest.mark.parametrize("verb", ["label", "export", "view", "replay"])
def test_the_verbs_end_with_exit_code_2_and_name_file_and_remedy(
    closed: Path, tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    damaged = copy(
        closed, tmp_path / "run", "series.mcap", lambda data: data.__setitem__(slice(60, 70), bytes(10))
    )
    assert run(["--json", "log", verb, str(damaged)]) == 2
    said = json.loads(capsys.readouterr().out)
    reason = said["unusable"][0]["reason"] if verb == "label" else said["error"]
    assert f"{damaged}/series.mcap byte " in reason
    assert "leave this run out" in reason


def test_one_damaged_flight_does_not_keep_the_others_from_their_labels(
    closed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damaged = copy(closed, tmp_path / "damaged", "series.mcap", lambda data: data.__setitem__(200, 0xFF))
    run(["--json", "log", "label", str(damaged), str(closed)])
    said = json.loads(capsys.readouterr().out)
    assert [entry["file"] for entry in said["unusable"]][:1] == [str(damaged)]
    assert str(closed) in [entry["file"] for entry in said["flights"] + said["unusable"]]


def _listed(root: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, bool]:
    assert run(["--json", "log", "list", str(root)]) == 0
    return {Path(one["folder"]).name: one["cut_off"] for one in json.loads(capsys.readouterr().out)["runs"]}


def test_a_copy_that_ended_early_is_told_from_a_killed_flight(
    closed: Path, killed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy(closed, tmp_path / "whole", "", lambda data: None)
    copy(killed, tmp_path / "killed", "", lambda data: None)
    cut = copy(closed, tmp_path / "cut", "series.mcap", lambda data: data.__delitem__(slice(-20_000, None)))
    empty = copy(closed, tmp_path / "empty", "series.mcap", lambda data: data.clear())
    assert _listed(tmp_path, capsys) == {"whole": False, "killed": False, "cut": True, "empty": True}
    run(["log", "list", str(tmp_path)])
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed if line.split()[-2:] == ["cut", "off"]] == ["cut", "empty"]
    assert [line.split()[0] for line in listed if line.split()[-1:] == ["open"]] == ["killed"]
    assert listed[-2:] == [
        "cut off: a damaged copy, copy it again",
        "open: its flight still writes it, or was killed",
    ]
    length = (cut / "series.mcap").stat().st_size
    told = f"series.mcap: cut off at byte {length} after it was closed, a damaged copy: fetch it again"
    (note,) = read_run(cut).torn
    assert told in note
    assert "not finished by its writer" in read_run(tmp_path / "killed").torn[0]
    assert run(["--json", "log", "label", str(cut), str(empty)]) == 2
    first, second = json.loads(capsys.readouterr().out)["unusable"]
    assert told in first["reason"]
    assert f"{empty}/series.mcap byte 0: the file ends here" in second["reason"]
    landings = ["--json", "gap", "landings", "--data", str(cut), "--vehicle", "crazyflie21-upgraded"]
    assert run([*landings, "--legs", "wide-long"]) == 2
    assert told in json.loads(capsys.readouterr().out)["error"]


def test_a_record_that_the_disk_ended_is_no_damaged_copy(tmp_path: Path, closed: Path) -> None:
    lost = copy(closed, tmp_path / "run", "series.mcap", lambda data: data.__delitem__(slice(-20_000, None)))
    info = json.loads((lost / "run.json").read_text())
    (lost / "run.json").write_text(json.dumps(with_checksum({**info, "record_lost": "the disk is full"})))
    record = read_run(lost)
    assert not record.cut_off
    assert "not finished by its writer" in record.torn[0]
    open_flight(lost)


def test_a_record_of_another_version_is_refused_by_its_name_and_not_called_damaged(
    closed: Path, tmp_path: Path
) -> None:
    def older(data: bytearray) -> None:
        data[:] = data.replace(b"perchhw.run/1", b"perchhw.run/0")

    set_back = copy(closed, tmp_path / "older", "run.json", older)
    with pytest.raises(RunFolderError, match=r"key 'schema': is \"perchhw\.run/0\", older than") as refused:
        read_run(set_back)
    assert "CRC-32" in str(refused.value)  # where it was a wrong bit, that is to be seen as well


def test_a_closed_record_without_its_events_is_damaged_and_a_killed_one_is_not(
    closed: Path, killed: Path, tmp_path: Path
) -> None:
    for original in (closed, killed):
        copy(original, tmp_path / original.parent.name, "", len)
        (tmp_path / original.parent.name / "events.jsonl").unlink()
    with pytest.raises(RunFolderError, match="missing from a record that was closed: fetch it again"):
        read_run(tmp_path / closed.parent.name)
    assert "events.jsonl: missing" in read_run(tmp_path / killed.parent.name).torn
