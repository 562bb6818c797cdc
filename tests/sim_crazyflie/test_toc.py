"""The tables of contents are the real firmware's: every row, and the CRC that the firmware computes."""

import json
from pathlib import Path

import pytest

from sim_backend.crazyflie.tables import LogTable, NoSuchTableEntry, ParameterTable, ValueNotRepresentable
from sim_backend.crazyflie.toc import (
    Block,
    Row,
    TocError,
    check_blocks,
    format_blocks,
    load_blocks,
    table_crc,
)

LOG_CRC, PARAM_CRC = 0xC104357B, 0x15952A0F


def test_crcs_are_the_firmwares_own() -> None:
    assert LogTable.firmware(with_app=False).crc == LOG_CRC
    assert ParameterTable.firmware(with_app=False).crc == PARAM_CRC


def test_sizes() -> None:
    logs, params = LogTable.firmware(with_app=False), ParameterTable.firmware(with_app=False)
    assert (len(logs), len(params)) == (567, 335)
    assert sum(entry.persistent for entry in params.entries) == 136
    assert sum(entry.read_only for entry in params.entries) == 38


def test_app_groups_come_last_and_change_both_crcs() -> None:
    for table, plain in (
        (LogTable.firmware(), LogTable.firmware(with_app=False)),
        (ParameterTable.firmware(), ParameterTable.firmware(with_app=False)),
    ):
        assert table.crc != plain.crc
        names = [entry.full_name for entry in table.entries]
        assert names[: len(plain)] == [entry.full_name for entry in plain.entries]
        assert {name.split(".")[0] for name in names[len(plain) :]} <= {"perch", "perchT", "perchM"}
    assert LogTable.firmware().crc != ParameterTable.firmware().crc


def test_equal_to_the_symbol_table_dump(shared_data: Path) -> None:
    dump = json.loads((shared_data / "crazyflie" / "toc_cf2_2026.08.json").read_text())
    logs = LogTable.firmware(with_app=False).entries
    assert [(e.ident, e.group, e.name, e.type_byte) for e in logs] == [
        (i["id"], i["group"], i["name"], i["type"]) for i in dump["log"]["items"]
    ]
    params = ParameterTable.firmware(with_app=False)
    assert [(e.ident, e.group, e.name, e.type_byte, e.extended_type) for e in params.entries] == [
        (i["id"], i["group"], i["name"], i["type"], i["ext_type"]) for i in dump["param"]["items"]
    ]
    for item in dump["param"]["items"]:
        name = f"{item['group']}.{item['name']}"
        assert params[name] == item["default"], name


def test_text_form_round_trips(tmp_path: Path) -> None:
    for kind in ("log", "param"):
        blocks = load_blocks(kind)
        path = tmp_path / f"{kind}.tsv"
        path.write_text(format_blocks(kind, blocks))
        assert load_blocks(kind, path) == blocks
        assert table_crc(load_blocks(kind, path)) == table_crc(blocks)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("g\tn\tu9", "no table row"),
        ("g\tn\tu8\tq", "no table row"),
        ("g", "no table row"),
        ("\tn\tu8", "names no group"),
        ("abcdefghijklm\tabcdefghijklm\tu8", "too long"),
        ("g\tn\tu8\n\tn\tu8", "twice"),
    ],
)
def test_bad_table_file_names_the_problem(tmp_path: Path, line: str, what: str) -> None:
    path = tmp_path / "param.tsv"
    path.write_text(line + "\n")
    with pytest.raises(TocError, match=what):
        load_blocks("param", path)


def test_longest_names_fit_one_packet() -> None:
    check_blocks([Block("a" * 12, (Row("b" * 12, 1),))])
    with pytest.raises(TocError, match="too long"):
        check_blocks([Block("a" * 12, (Row("b" * 13, 1),))])


def test_firmware_side_set_is_read_back_and_announced() -> None:
    params = ParameterTable.firmware()
    params["hlCommander.vtoff"] = 0.25
    params["perch.polStat"] = 16
    assert params["hlCommander.vtoff"] == 0.25
    assert params["perch.polStat"] == 16
    assert params.take_updates() == [params.entry("hlCommander.vtoff").ident]  # read-only: no notice
    assert params.take_updates() == []


@pytest.mark.parametrize(
    ("name", "value"), [("perch.go", 256), ("perch.go", -1), ("perch.go", 0.5), ("perch.vx", 1e39)]
)
def test_value_that_does_not_fit_is_refused(name: str, value: float) -> None:
    params = ParameterTable.firmware()
    with pytest.raises(ValueNotRepresentable, match=name):
        params[name] = value
    assert params[name] == 0


def test_reset_restores_defaults_and_stored_values() -> None:
    params = ParameterTable.firmware()
    params["ring.effect"] = 9
    params["perch.go"] = 1
    effect, go = params.entry("ring.effect").ident, params.entry("perch.go").ident
    assert params.store(effect)
    assert not params.store(go)
    params["ring.effect"] = 3
    params.reset()
    assert (params["ring.effect"], params["perch.go"]) == (9, 0)
    assert params.take_updates() == []
    assert params.clear(effect)
    assert not params.clear(effect)
    params.reset()
    assert params["ring.effect"] == 6


def test_unknown_names_are_errors_and_unbound_logs_read_zero() -> None:
    logs = LogTable.firmware()
    assert logs["stateEstimate.x"] == 0
    logs.bind("stateEstimate.x", lambda: 1.5)
    assert logs["stateEstimate.x"] == 1.5
    with pytest.raises(NoSuchTableEntry, match=r"nothing\.here"):
        logs.bind("nothing.here", lambda: 0)
    with pytest.raises(NoSuchTableEntry, match=r"nothing\.here"):
        ParameterTable.firmware()["nothing.here"]
