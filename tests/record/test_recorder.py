"""The record survives what kills its writer."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from subprocess import PIPE

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from onboard.errors import InputError
from onboard.record.run_record import RunFolderError
from perchhw.record import TOPICS, RecordError, RunRecorder, discard_if_empty, new_run_folder, read_run
from tests.drawn_examples import examples

POSE = {
    "x": 0.1,
    "y": -0.2,
    "z": 1.5,
    "qx": 0.0,
    "qy": 0.0,
    "qz": 0.0,
    "qw": 1.0,
    "frame": 7,
    "verdict": "ok",
}

WRITER = """
import sys, time
from pathlib import Path
from perchhw.record import RunRecorder
recorder = RunRecorder(Path(sys.argv[1]), {"ceiling_z": 2.1})
n = 0
while True:
    t = time.monotonic()
    recorder.write("pose", t, {"x": float(n), "frame": n, "verdict": "ok"})
    recorder.event("tick", t, n=n)
    sys.stdout.write(f"{n} {t!r}\\n")
    sys.stdout.flush()
    n += 1
"""


def test_a_sigkilled_writer_loses_nothing_that_write_returned_for(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-c", WRITER, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if int(line.split()[0]) >= 300:
                break
        os.kill(child.pid, signal.SIGKILL)
        reported = [line for line in [line, *child.stdout] if line.endswith("\n")]
        assert child.wait(timeout=120) == -signal.SIGKILL
    last_number, last_time = int(reported[-1].split()[0]), float(reported[-1].split()[1])

    run = read_run(folder)

    frames = run.series["pose"].numbers("frame")
    assert frames[-1] >= last_number
    assert frames.tolist() == list(range(len(frames)))
    assert run.series["pose"].t[-1] >= last_time - 1e-6
    assert [e["n"] for e in run.events][: last_number + 1] == list(range(last_number + 1))
    assert not run.closed
    assert any("not finished by its writer" in note for note in run.torn)


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "whole"
    with RunRecorder(folder, {"ceiling_z": 2.1}, clock=lambda: 5.0) as recorder:
        for i in range(40):
            recorder.write("pose", i * 0.01, {**POSE, "frame": i})
            recorder.write("rates", i * 0.01, {"gx": math.nan, "gy": -math.inf, "gz": float(i)})
            recorder.event("tick", i * 0.01, n=i)
        recorder.close(outcome="four_leg", triggered=True)
    return folder


@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 1.0), events_share=st.floats(0.0, 1.0))
def test_truncation_at_any_byte_keeps_every_complete_message(
    finished_run: Path, tmp_path: Path, share: float, events_share: float
) -> None:
    whole = (finished_run / "series.mcap").read_bytes()
    events = (finished_run / "events.jsonl").read_bytes()
    cut, events_cut = int(share * len(whole)), int(events_share * len(events))
    torn = tmp_path / "torn"
    torn.mkdir(exist_ok=True)
    (torn / "run.json").write_bytes((finished_run / "run.json").read_bytes())
    (torn / "series.mcap").write_bytes(whole[:cut])
    (torn / "events.jsonl").write_bytes(events[:events_cut])

    if cut < 8:
        with pytest.raises(RunFolderError, match=rf"series\.mcap byte {cut}: "):
            read_run(torn)
        return
    run = read_run(torn)

    ends = _message_ends(whole)
    complete = sum(end <= cut for end in ends)
    assert sum(len(s.t) for s in run.series.values()) == complete
    assert len(run.events) == events[:events_cut].count(b"\n")
    if cut < ends[-1]:
        assert run.cut_off
        assert any(f"series.mcap: cut off at byte {cut} after it was closed" in note for note in run.torn)


def _message_ends(data: bytes) -> list[int]:
    """Independent of the reader: walk the records by their length fields (MCAP specification)."""
    ends, position = [], 8
    while position + 9 <= len(data):
        end = position + 9 + int.from_bytes(data[position + 1 : position + 9], "little")
        if data[position] == 0x05:
            ends.append(end)
        if data[position] == 0x0F:
            break
        position = end
    return ends


def test_a_closed_record_reads_back_as_written(finished_run: Path) -> None:
    run = read_run(finished_run)
    assert run.torn == ()
    assert run.closed
    assert run.info["outcome"] == "four_leg"
    assert run.config == {"ceiling_z": 2.1}
    assert run.info["versions"]["perchhw"]
    pose = run.series["pose"]
    assert pose.t[3] == pytest.approx(0.03, abs=1e-9)
    assert pose.messages[3] == {**POSE, "frame": 3}
    assert pose.texts("verdict") == ("ok",) * 40
    assert math.isnan(run.series["rates"].messages[0]["gx"])
    assert run.series["rates"].messages[0]["gy"] == -math.inf


def test_the_file_is_plain_mcap_for_other_readers(finished_run: Path) -> None:
    with (finished_run / "series.mcap").open("rb") as stream:
        messages = list(make_reader(stream).iter_messages())
    assert len(messages) == 80
    schema, channel, message = messages[0]
    assert (channel.topic, channel.message_encoding, schema.encoding) == ("pose", "json", "jsonschema")
    assert json.loads(message.data) == {**POSE, "frame": 0}
    assert set(json.loads(schema.data)["properties"]) == {f.name for f in TOPICS["pose"].fields}


def test_writers_in_several_threads_do_not_tear_each_other(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path / "run", {})

    def work(number: int) -> None:
        for i in range(400):
            recorder.write("pose", time.monotonic(), {**POSE, "x": float(number), "frame": i})
            recorder.event("tick", 0.0, thread=number)

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    recorder.close()
    run = read_run(tmp_path / "run")
    assert run.torn == ()
    for number in range(4):
        rows = run.series["pose"].numbers("x") == number
        assert run.series["pose"].numbers("frame")[rows].tolist() == list(range(400))
    assert len(run.events) == 1600


def test_what_the_schema_does_not_have_is_refused(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        with pytest.raises(RecordError, match="no field speed"):
            recorder.write("pose", 0.0, {"speed": 1.0})
        with pytest.raises(RecordError, match="'odometry' is not in"):
            recorder.write("odometry", 0.0, {})
        with pytest.raises(RecordError, match="finite"):
            recorder.write("pose", math.nan, POSE)
    with pytest.raises(RecordError, match="closed"):
        recorder.write("pose", 0.0, POSE)
    with pytest.raises(RecordError, match="already holds a record"):
        RunRecorder(tmp_path / "run", {})


def test_an_error_inside_the_run_is_recorded(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), RunRecorder(tmp_path / "run", {}):
        raise KeyboardInterrupt
    run = read_run(tmp_path / "run")
    assert run.closed
    assert run.info["error"].startswith("KeyboardInterrupt")


def test_update_reaches_run_json_at_once(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        recorder.update(policy_crc32=17)
        assert read_run(tmp_path / "run").info["policy_crc32"] == 17


def test_run_folders_of_one_second_differ(tmp_path: Path) -> None:
    first = new_run_folder(tmp_path, "Fly 2.5 m/s, 40 deg!")
    second = new_run_folder(tmp_path, "Fly 2.5 m/s, 40 deg!")
    assert first.name.endswith("Z-fly-2.5-m-s-40-deg")
    assert first != second
    with RunRecorder(first, {}) as recorder:
        recorder.event("a", 0.0)
    discard_if_empty(first)
    discard_if_empty(second)
    assert [path.name for path in tmp_path.iterdir()] == [first.name]


def test_run_folders_of_two_processes_differ(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from onboard.record.folder import new_run_folder\n"
        "sys.stdin.readline()\n"
        "for _ in range(100): print(new_run_folder(Path(sys.argv[1]) / 'runs', 'fly'))"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    both = [subprocess.Popen(command, stdin=PIPE, stdout=PIPE, text=True) for _ in range(2)]
    for process in both:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    names = [name for process in both for name in process.communicate(timeout=200)[0].split()]
    assert len(names) == 200
    assert len(set(names)) == 200


@pytest.mark.parametrize("parent", ["a-file", "a-file/below"])
def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path, parent: str) -> None:
    (tmp_path / "a-file").write_text("")
    for use in (lambda folder: new_run_folder(folder, "fly"), lambda folder: RunRecorder(folder, {})):
        with pytest.raises(InputError, match=f"{tmp_path / parent}: cannot be written"):
            use(tmp_path / parent)


def test_damage_before_the_end_names_the_place(finished_run: Path, tmp_path: Path) -> None:
    data = bytearray((finished_run / "series.mcap").read_bytes())
    end = _message_ends(bytes(data))[5]
    data[end - 5 : end] = b"\xff" * 5
    for name in ("run.json", "events.jsonl"):
        (tmp_path / name).write_bytes((finished_run / name).read_bytes())
    (tmp_path / "series.mcap").write_bytes(data)
    with pytest.raises(RunFolderError, match=r"series\.mcap byte \d+: damaged message"):
        read_run(tmp_path)
    (tmp_path / "series.mcap").write_bytes((finished_run / "series.mcap").read_bytes())
    (tmp_path / "events.jsonl").write_text('{"t": 0, "event": "a"}\nnonsense\n')
    with pytest.raises(RunFolderError, match=r"events\.jsonl line 2"):
        read_run(tmp_path)
    with pytest.raises(RunFolderError, match="is not a run folder"):
        read_run(tmp_path / "missing")
