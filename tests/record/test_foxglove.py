"""A run for Foxglove, read back by mcap's reader and judged by Foxglove's own message definitions."""

import importlib
import importlib.util
import json
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from onboard.record.run_record import RunFolderError
from onboard.record.topics import TOPICS
from perchhw.cli.main import run as perchhw
from perchhw.record.export import ExportFormat, export_run
from perchhw.record.foxglove_types import TYPES
from perchhw.record.run import read_run
from tests.view.flown import BEGIN, FLIP, GONE, STEPS, record

needs_definitions = pytest.mark.skipif(
    importlib.util.find_spec("foxglove_schemas_protobuf") is None,
    reason="Foxglove's definitions are not installed: pip install foxglove-schemas-protobuf",
)
Messages = dict[str, list[tuple[int, str, dict[str, Any]]]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("foxglove") / "run")


@pytest.fixture(scope="module")
def exported(folder: Path) -> Messages:
    """By topic: log time, schema, message; every key of a message is in the schema that the file carries."""
    assert perchhw(["log", "export", str(folder), "--to", "foxglove"]) == 0
    found: Messages = {}
    with (folder / "export" / "foxglove.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            values = json.loads(message.data, parse_constant=pytest.fail)
            check(values, json.loads(schema.data))
            found.setdefault(channel.topic, []).append((message.log_time, schema.name, values))
    return found


def check(value: Any, schema: dict[str, Any]) -> None:
    """What JSON schema asks of types and known keys."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int}
    kind = kinds.get(schema["type"], (int, float))
    assert isinstance(value, kind), (value, schema)
    if isinstance(value, dict):
        assert value.keys() <= schema["properties"].keys()
        for key, part in value.items():
            check(part, schema["properties"][key])
    if isinstance(value, list):
        for part in value:
            check(part, schema["items"])


def test_what_is_drawn_and_what_is_plotted(exported: Messages) -> None:
    drawn = {topic: {schema for _, schema, _ in rows} for topic, rows in exported.items()}
    assert drawn["/tf"] == {"foxglove.FrameTransform"}
    assert drawn["/mocap/pose"] == drawn["/estimate/pose"] == {"foxglove.PoseInFrame"}
    assert drawn["/log"] == {"foxglove.Log"}
    for scene in ("room", "path", "drone", "trigger"):
        assert drawn[f"/scene/{scene}"] == {"foxglove.SceneUpdate"}
    assert {f"/{topic}" for topic in TOPICS} - drawn.keys() == {"/acceleration"}  # it was not measured
    assert len(exported["/tf"]) == STEPS - 1  # not where it was occluded


def test_time_is_that_of_the_calendar(folder: Path, exported: Messages) -> None:
    began = datetime.fromisoformat(json.loads((folder / "run.json").read_text())["started_utc"]).timestamp()
    for rows in exported.values():
        for log_time, _, message in rows:
            stamp = message.get("timestamp") or message["entities"][0]["timestamp"]
            assert stamp["sec"] * 1_000_000_000 + stamp["nsec"] == log_time
            assert 0.0 <= log_time * 1e-9 - began < 0.01 * STEPS + 1e-3


def test_units_are_in_the_names(exported: Messages) -> None:
    first = {topic: set(rows[-1][2]) - {"timestamp", "drone_time_ms"} for topic, rows in exported.items()}
    assert first["/cues"] == {"tau_s", "theta_x_1_s", "d_ceil_m", "trigger_value", "a_rot_n_m"}
    assert first["/rates"] == {"gx_rad_s", "gy_rad_s", "gz_rad_s"}
    assert first["/motors"] == {f"m{i}_pwm_u16" for i in (1, 2, 3, 4)}
    assert first["/power"] == {"vbat_v"}


def test_a_number_that_plots_cannot_show_is_left_out(exported: Messages) -> None:
    cues = [message for _, _, message in exported["/cues"] if "theta_x_1_s" in message]
    assert cues[0]["tau_s"] == 1.4e6
    assert "tau_s" not in cues[1]  # minus infinity
    occluded = [message for _, _, message in exported["/pose"]][GONE]
    assert occluded["verdict"] == "occluded"
    assert "x_m" not in occluded


def test_the_drone_hangs_in_its_frame_and_the_trigger_where_it_flipped(exported: Messages) -> None:
    _, _, transform = exported["/tf"][-1]
    (drone,) = exported["/scene/drone"][0][2]["entities"]
    assert drone["frame_id"] == transform["child_frame_id"]
    assert transform["parent_frame_id"] == exported["/scene/room"][0][2]["entities"][0]["frame_id"]
    (trigger,) = exported["/scene/trigger"][0][2]["entities"]
    assert trigger["spheres"][0]["pose"]["position"]["x"] == pytest.approx(-1.0 + 0.008 * FLIP)
    levels = {message["message"]: message["level"] for _, _, message in exported["/log"]}
    assert levels["phase: flipping (ended by pose_lost)"] == 3


@needs_definitions
def test_foxglove_s_own_definitions_take_every_message(exported: Messages) -> None:
    """By protobuf's JSON parser, which refuses unknown fields and wrong types."""
    parse = importlib.import_module("google.protobuf.json_format").ParseDict
    judged = 0
    for rows in exported.values():
        for _, schema, message in rows[:20]:
            if schema not in TYPES:
                continue
            name = schema.removeprefix("foxglove.")
            kind = getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)
            parse(as_protobuf(message), kind())
            judged += 1
    assert judged > 40


def as_protobuf(value: Any) -> Any:
    """Times as protobuf writes them in JSON; Foxglove's JSON has {sec, nsec}."""
    if isinstance(value, list):
        return [as_protobuf(part) for part in value]
    if not isinstance(value, dict):
        return value
    fields = {key: as_protobuf(part) for key, part in value.items()}
    if "timestamp" in value:
        stamp = importlib.import_module("google.protobuf.timestamp_pb2").Timestamp
        sec, nsec = (int(value["timestamp"][key]) for key in ("sec", "nsec"))
        fields["timestamp"] = stamp(seconds=sec, nanos=nsec).ToJsonString()
    if "lifetime" in value:
        assert value["lifetime"] == {"sec": 0, "nsec": 0}  # for ever
        fields["lifetime"] = "0s"
    return fields


@pytest.mark.parametrize("format", [ExportFormat.FOXGLOVE, ExportFormat.ROS2])
def test_a_record_without_its_beginning_is_refused_by_name(
    folder: Path, tmp_path: Path, format: ExportFormat
) -> None:
    run = read_run(folder)
    assert run.info["clock_at_start"] == BEGIN
    for key in ("started_utc", "clock_at_start"):
        broken = {**run.info, key: None}
        with pytest.raises(RunFolderError, match=rf"run\.json key '{key}': None is no"):
            export_run(type(run)(run.folder, broken, run.series, run.events, ()), tmp_path, format)
    assert list(tmp_path.iterdir()) == []
