"""Tables as CSV: what is written reads back, and what is broken is named by row and column."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.csv_file import read_csv, write_csv
from onboard.errors import OnboardError


class BrokenTable(OnboardError):
    """Of these tests."""


@given(st.lists(st.tuples(st.floats(allow_nan=False, allow_infinity=False), st.integers(-(2**62), 2**62))))
@pytest.mark.parametrize("name", ["t.csv", "t.csv.gz"])
def test_numbers_read_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, name: str, rows: list[tuple[float, int]]
) -> None:
    path = tmp_path_factory.getbasetemp() / name
    write_csv(path, ("x", "n"), ((repr(x), str(n)) for x, n in rows))
    table = read_csv(path, BrokenTable)
    assert table.finite("x").tolist() == [x for x, _ in rows]
    assert table.integers("n").tolist() == [n for _, n in rows]


def test_the_same_rows_give_the_same_bytes(tmp_path: Path) -> None:
    path = tmp_path / "t.csv.gz"
    write_csv(path, ("x",), [("1",)])
    first = path.read_bytes()
    path.unlink()
    write_csv(path, ("x",), [("1",)])
    assert path.read_bytes() == first
    assert first[4:8] == bytes(4), "no time of writing in the header"


def test_comments_count_as_lines_and_a_byte_order_mark_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("# from a bench\nx,n\n\n1,2\n# a pause\n,3.5\n", encoding="utf-8")
    table = read_csv(path, BrokenTable, comment="#")
    assert [row.number for row in table.rows] == [4, 6]
    with pytest.raises(BrokenTable, match="row 6 column 'x': '' is not a finite number"):
        table.finite("x")
    with pytest.raises(BrokenTable, match=r"row 6 column 'n': '3\.5' is not a whole number"):
        table.integers("n")
    with pytest.raises(BrokenTable, match="no column 'y'; found x, n"):
        table.text("y")
    path.write_text("x,n\n1,2\n", encoding="utf-8-sig")
    assert read_csv(path, BrokenTable).header == ("x", "n")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty first row"),
        (b"x,n\n1\n", "row 2: 1 cells where the header has 2"),
        (b"x,n\n1,\xff\n", "cannot be read after row 1"),
        (b"n,x,n\n1,2,3\n", "row 1: column given twice: n"),
        (f"n\n{2**63}\n".encode(), "row 2 column 'n': '9223372036854775808' is too large"),
    ],
)
def test_what_is_broken_is_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(BrokenTable, match=words):
        read_csv(path, BrokenTable).integers("n")
    with pytest.raises(BrokenTable, match="check the path"):
        read_csv(tmp_path / "none.csv", BrokenTable)
