"""A record that is followed while it is written: every message once, whole, in its order; damage is named."""

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from onboard.record.checksum import with_checksum
from onboard.record.growing_run import GrowingRun
from onboard.record.run_record import RunFolderError
from perchhw.record import RunRecorder
from perchhw.record.run import read_run
from tests.drawn_examples import examples
from tests.record.test_damage import FILES, write

shares = st.lists(st.floats(0.0, 1.0), max_size=6).map(sorted)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "run", close=True)


@settings(max_examples=examples(40), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(series_shares=shares, event_shares=shares)
def test_whatever_the_pieces_it_adds_up(
    whole: Path, tmp_path: Path, series_shares: list[float], event_shares: list[float]
) -> None:
    folder = tmp_path / "run"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    content = {name: (whole / name).read_bytes() for name in FILES}
    open_info = with_checksum({**json.loads(content["run.json"]), "closed": False})
    (folder / "run.json").write_text(json.dumps(open_info))
    run, times, messages, events = GrowingRun(folder), {}, {}, []
    pieces = [(0.0, 0.0), *zip(series_shares, event_shares, strict=False), (1.0, 1.0)]
    for series_share, event_share in pieces:
        for name, share in (("series.mcap", series_share), ("events.jsonl", event_share)):
            (folder / name).write_bytes(content[name][: int(share * len(content[name]))])
        if (series_share, event_share) == (1.0, 1.0):
            (folder / "run.json").write_bytes(content["run.json"])
        news = run.look()
        events += news.events
        for topic, series in news.series.items():
            times.setdefault(topic, []).extend(series.t)
            messages.setdefault(topic, []).extend(series.messages)
    expected = read_run(whole)
    assert run.closed
    assert repr(events) == repr(list(expected.events))
    assert times == {topic: list(series.t) for topic, series in expected.series.items()}
    assert repr(messages) == repr({topic: list(s.messages) for topic, s in expected.series.items()})


def test_it_follows_the_writer_itself(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        run = GrowingRun(tmp_path / "run")
        assert (run.look().series, run.closed) == ({}, False)
        recorder.write("rates", 1.0, {"gx": 0.5})
        recorder.event("phase", 1.0, phase="hover")
        news = run.look()
        assert [m["gx"] for m in news.series["rates"].messages] == [0.5]
        assert [event["phase"] for event in news.events] == ["hover"]
        assert run.look().series == {}
    assert run.look().series == {}
    assert run.closed


def test_damage_is_named_with_its_byte(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "run"))
    data = bytearray((folder / "series.mcap").read_bytes())
    (folder / "series.mcap").write_bytes(data[:9000])
    run = GrowingRun(folder)
    run.look()
    data[9500:9600] = bytes(100)
    (folder / "series.mcap").write_bytes(data)
    with pytest.raises(RunFolderError, match=r"series\.mcap byte \d+: "):
        run.look()
