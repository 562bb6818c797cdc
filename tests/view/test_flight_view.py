"""What a view holds, read back by Rerun's own reader; a live one ends up the same as a recorded one."""

import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from onboard.record.checksum import with_checksum
from onboard.record.growing_run import GrowingRun
from perchhw.cli.main import run as perchhw
from perchhw.view.flight_view import follow
from tests.view.flown import FLIP, GONE, STEPS, record
from tests.view.rrd import read

Recording = dict[str, dict[str, list[tuple[float, Any]]]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("flown") / "20260101T000000Z-run")


@pytest.fixture(scope="module")
def shown(flown: Path) -> Recording:
    file = flown / "sub" / "flight.rrd"
    assert perchhw(["view", str(flown), "--save", str(file)]) == 0
    return read(file)


def scalars(shown: Recording, entity: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([value[0] for _, value in shown[f"plots/{entity}"]["Scalars:scalars"]])


def test_one_tau_of_a_million_seconds_does_not_flatten_the_plot(shown: Recording) -> None:
    tau = scalars(shown, "tau/tau_s")
    assert tau[0] == 2.0
    assert tau[1] == 0.0
    assert tau[50] == pytest.approx(0.69)
    assert np.ptp(tau) <= 2.0


def test_every_curve_names_its_unit_in_path_and_legend(shown: Recording) -> None:
    curves = [entity for entity in shown if entity.startswith("plots/")]
    assert len(curves) > 15
    endings = ("_s", "_m", "_percent", "_v", "_ms", "_mm", "trigger_value")
    for entity in curves:
        ((_, (label,)),) = shown[entity]["SeriesLines:names"]
        assert entity.endswith(endings), entity
        assert label.endswith("]"), label


def test_values_are_in_their_units(shown: Recording) -> None:
    assert [scalars(shown, f"motors/m{i}_percent")[0] for i in (1, 2, 3, 4)] == [100.0, 0.0, 10.0, 50.0]
    assert scalars(shown, "link/mocap_age_ms") == pytest.approx(4.0, abs=1e-6)
    assert scalars(shown, "estimate_error/estimate_error_mm") == pytest.approx(3.0, abs=1e-6)
    gaps = scalars(shown, "link/link_gap_ms")
    assert sorted(gaps)[-2:] == pytest.approx([10.0, 20.0], abs=1e-6)
    assert scalars(shown, "link/mocap_gap_ms") == pytest.approx(10.0, abs=1e-6)


def luminance(colour: int) -> float:
    """Relative luminance of an RGBA colour (WCAG 2.1)."""
    parts = [(colour >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def as_deuteranope(colour: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Linear RGB as seen without the middle cones (Viénot, Brettel and Mollon 1999)."""
    rgb = np.array([(colour >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]) ** 2.2
    seen = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]])
    return np.asarray(seen @ rgb, dtype=np.float64)


@pytest.mark.parametrize("group", [("gx", "gy", "gz"), ("vx", "vy", "vz")])
def test_the_axes_can_be_told_apart_in_print_and_without_red_and_green(
    shown: Recording, group: tuple[str, ...]
) -> None:
    panel, unit = ("rates", "rad_s") if group[0] == "gx" else ("velocity", "m_s")
    colours = [shown[f"plots/{panel}/{name}_{unit}"]["SeriesLines:colors"][0][1][0] for name in group]
    for one, other in itertools.combinations(colours, 2):
        high, low = sorted((luminance(one), luminance(other)), reverse=True)
        assert (high + 0.05) / (low + 0.05) > 1.1 or np.linalg.norm(
            as_deuteranope(one) - as_deuteranope(other)
        ) > 0.3
        assert np.linalg.norm(as_deuteranope(one) - as_deuteranope(other)) > 0.2


def test_the_room_with_the_drone_and_where_it_goes(shown: Recording) -> None:
    for part in ("drone/legs", "drone/propellers", "cage", "ceiling", "reference_path"):
        assert f"room/{part}" in shown
    places = shown["room/drone"]["Transform3D:translation"]
    assert len(places) == STEPS - 1  # an occluded pose moves nothing
    assert all(abs(t - 0.01 * GONE) > 1e-6 for t, _ in places)
    ((_, (strip,)),) = shown["room/reference_path"]["LineStrips3D:strips"]
    targets = shown["room/target"]["Points3D:positions"]
    assert targets[0][1][0] == pytest.approx(strip[0])
    assert targets[-1][1][0][0] > targets[0][1][0][0]
    assert targets[-1][0] < 0.01 * FLIP  # nothing to aim at once it flips
    ((t, [trigger]),) = shown["room/trigger"]["Points3D:positions"]
    assert t == pytest.approx(0.01 * FLIP, abs=1e-8)
    assert trigger == pytest.approx([-1.0 + 0.008 * FLIP, 0.0, 1.0], abs=1e-6)


def test_the_state_moves_within_the_box_of_the_optical_flow_space(shown: Recording) -> None:
    states = np.array([point[0] for _, point in shown["cue_space/state"]["Points3D:positions"]])
    assert states.shape == (STEPS - 1, 3)
    assert 0.0 <= states.min() <= states.max() <= 1.0
    for face in ("fires_from", "fires_until"):
        ((_, vertices),) = shown[f"cue_space/{face}"]["Mesh3D:vertex_positions"]
        assert np.min(vertices) >= 0.0
        assert np.max(vertices) <= 1.0


def test_what_happened_in_words(shown: Recording) -> None:
    levels = [level for _, (level,) in shown["events"]["TextLog:level"]]
    lines = [text for _, (text,) in shown["events"]["TextLog:text"]]
    assert "failed: go to x -3.25, y 0.00, z 0.48 m: no answer" in lines
    said = dict(zip(lines, levels, strict=True))
    assert said["phase: flipping (ended by pose_lost)"] == "WARN"
    assert [said["mocap: ok"], said["mocap: occluded"]] == ["INFO", "WARN"]
    assert lines.count("mocap: ok") == 2  # before and after, not with every frame
    assert said["drone's supervisor: armed, flying, tumbled"] == "WARN"


def growing(whole: Path, folder: Path) -> Iterator[None]:
    """Write the files of `whole` to `folder` in unequal pieces, ``run.json`` closed last."""
    folder.mkdir()
    info = (whole / "run.json").read_text()
    (folder / "run.json").write_text(json.dumps(with_checksum({**json.loads(info), "closed": False})))
    series, events = ((whole / name).read_bytes() for name in ("series.mcap", "events.jsonl"))
    for share in (0.001, 0.13, 0.34567, 0.35, 0.9, 1.0):
        (folder / "series.mcap").write_bytes(series[: int(share * len(series))])
        (folder / "events.jsonl").write_bytes(events[: int(share * len(events))])
        yield
    (folder / "run.json").write_text(info)
    yield


def in_order(components: dict[str, list[tuple[float, Any]]]) -> list[tuple[str, list[str]]]:
    """Comparable: what has the same time came in the order in which it was looked at."""
    return sorted((name, sorted(map(repr, rows))) for name, rows in components.items())


def test_a_live_view_ends_up_as_the_recorded_one(flown: Path, shown: Recording, tmp_path: Path) -> None:
    pieces = growing(flown, tmp_path / "run")
    next(pieces)
    stream = rr.RecordingStream("perchhw", recording_id=flown.name)
    stream.save(tmp_path / "live.rrd")
    follow(GrowingRun(tmp_path / "run"), stream, lambda _: next(pieces), lambda: False, stream.flush)
    stream.disconnect()
    live = read(tmp_path / "live.rrd")
    assert live.keys() == shown.keys()
    for entity in shown.keys() - {"__properties"}:
        assert in_order(live[entity]) == in_order(shown[entity]), entity


def test_a_view_is_refused_where_nothing_can_be_shown(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert perchhw(["view", str(tmp_path)]) == 2
    assert f"{tmp_path}: no run here to show" in capsys.readouterr().err
    assert perchhw(["log", "view", str(flown), "--save", "x.rrd", "--web"]) == 2
