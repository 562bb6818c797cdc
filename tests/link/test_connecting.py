"""What a connection asks, how much of it at once, and what is kept of the answers for the next."""

import json
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.link import DroneLink
from onboard.link.deadline import SLACK, GrowingDeadline
from onboard.link.errors import LinkError
from onboard.link.exchange import UNDER_WAY
from onboard.link.table_cache import Rows, TableCache
from tests.link.tiny_drone import LOGS, MEMORY_TYPE, PARAMETERS, TinyDrone
from tests.patience import patient_link, patient_uri, until

ROWS: Rows = [(6, "pm.vbat"), (0x48, "perch.version")]
TABLE = ("logs", 0xC104357B)


def open_with(tiny: TinyDrone, folder: Path) -> list[bytes]:
    """Connect and close; the requests of tables' rows that it took."""
    before = len(tiny.requests)
    DroneLink.open(patient_uri(tiny.uri), toc_cache=folder).close()
    return [r for r in tiny.requests[before:] if r[0] & 0xF3 in (0x20, 0x50) and r[1] == 2]


def test_a_connection_reads_no_parameter_and_no_memory(tiny: TinyDrone) -> None:
    with patient_link(tiny.uri) as link:
        assert not tiny.count(0x21)
        assert not tiny.count(0x41)
        assert link.read_memory(MEMORY_TYPE, 0, 5) == bytes(5)
        assert link.param("ring.solid") == 0.25


def test_a_radio_that_is_not_there_is_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    """It asks for the dongle, not for the drone."""
    with pytest.raises(
        LinkError, match=r"^cannot open radio://9/80/2M: .*; is a Crazyradio plugged in, and free\?$"
    ):
        DroneLink.open("radio://9/80/2M")
    assert "Traceback" not in capfd.readouterr().err


def test_only_memories_that_exist_are_asked_for(tiny: TinyDrone) -> None:
    with patient_link(tiny.uri):
        asked = dict.fromkeys(request[1:] for request in tiny.requests if request[0] & 0xF3 == 0x40)
    assert list(asked) == [b"\x01", b"\x02\x00"], "an unknown one restarts the drone"  # repeated or not


def test_no_more_questions_are_under_way_than_the_drone_has_room_for(tiny: TinyDrone, tmp_path: Path) -> None:
    held = threading.Event()

    def rows_wait(request: bytes) -> bool:
        return request[0] & 0xF3 in (0x20, 0x50) and request[1] == 2 and not held.is_set()

    tiny.drop = rows_wait
    opening = threading.Thread(target=open_with, args=(tiny, tmp_path))
    opening.start()
    try:
        until(lambda: len(set(filter(rows_wait, list(tiny.requests)))) == UNDER_WAY)
        threading.Event().wait(0.3)  # in which each is repeated
        assert len(set(filter(rows_wait, list(tiny.requests)))) == UNDER_WAY <= 5
    finally:
        held.set()
        opening.join()


def test_tables_are_kept_for_the_next_connection(tiny: TinyDrone, tmp_path: Path) -> None:
    folder = tmp_path / "tables"
    assert len(set(open_with(tiny, folder))) == len(LOGS) + len(PARAMETERS)
    assert open_with(tiny, folder) == []
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("damage", [b"", b"{", b"\xff\xfe", b"null", b'{"schema": "perchhw.toc/1"}'])
def test_a_damaged_table_is_read_again_and_kept_anew(tiny: TinyDrone, tmp_path: Path, damage: bytes) -> None:
    open_with(tiny, tmp_path)
    files = sorted(tmp_path.glob("*.json"))
    assert len(files) == 2
    whole = [file.read_bytes() for file in files]
    for file in files:
        file.write_bytes(damage)
    assert open_with(tiny, tmp_path)
    assert [file.read_bytes() for file in files] == whole
    assert sorted(tmp_path.iterdir()) == files


@given(st.data())
def test_no_changed_byte_passes(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("tables")
    cache = TableCache(folder)
    cache.keep(*TABLE, ROWS)
    (file,) = folder.iterdir()
    text = bytearray(file.read_bytes())
    place = data.draw(st.integers(0, len(text) - 1))
    text[place] ^= data.draw(st.integers(1, 255))
    file.write_bytes(text)
    assert cache.fetch(*TABLE, len(ROWS)) in (None, ROWS)


def test_a_table_of_another_length_or_checksum_is_not_taken(tmp_path: Path) -> None:
    cache = TableCache(tmp_path)
    cache.keep(*TABLE, ROWS)
    assert cache.fetch(*TABLE, 2) == ROWS
    assert cache.fetch(*TABLE, 3) is None
    assert cache.fetch("parameters", TABLE[1], 2) is None
    assert cache.fetch("logs", TABLE[1] + 1, 2) is None


def test_a_folder_that_others_can_write_to_is_not_used(tmp_path: Path) -> None:
    cache = TableCache(tmp_path)
    cache.keep(*TABLE, ROWS)
    tmp_path.chmod(0o777)
    assert cache.fetch(*TABLE, 2) is None
    cache.keep("logs", 1, ROWS)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_link_in_the_place_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    TableCache(tmp_path / "real").keep(*TABLE, ROWS)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert TableCache(tmp_path / "link").fetch(*TABLE, 2) is None


def test_where_nothing_can_be_kept_the_drone_is_asked_each_time(tiny: TinyDrone, tmp_path: Path) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("")
    assert open_with(tiny, occupied)
    assert open_with(tiny, occupied)


def test_several_writers_leave_one_whole_table(tmp_path: Path) -> None:
    long: Rows = [(6, f"group.variable{number}") for number in range(500)]

    def write_and_read(_: int) -> bool:
        cache = TableCache(tmp_path)
        cache.keep(*TABLE, long)
        return cache.fetch(*TABLE, 500) == long

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(write_and_read, range(64)))
    (file,) = tmp_path.iterdir()
    assert json.loads(file.read_text())["schema"] == "perchhw.toc/1"


def test_the_deadline_moves_away_with_the_time_of_an_answer() -> None:
    deadline = GrowingDeadline(100.0, 10.0)
    deadline.expect(900)
    assert deadline.at == 110.0
    deadline.answered(0.06)
    assert deadline.at == pytest.approx(110.0 + SLACK * 0.06 * 900)
    deadline.answered(0.02)
    assert deadline.at == pytest.approx(110.0 + SLACK * 0.04 * 900)
