"""The database file of a campaign: opened, held against damage, its errors told as those of the folder."""

import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from onboard.errors import InputError
from onboard.json_file import parsed
from perchhw.errors import FlightStackError

DATABASE = "campaign.db"
_Shaped = TypeVar("_Shaped")


class CampaignError(FlightStackError, InputError):
    """A campaign folder cannot be used as asked; the message says what to do."""


@contextmanager
def kept_in(folder: Path) -> Iterator[None]:
    """An error of the database within is one of the folder.

    Raises:
        CampaignError: it cannot be written.
    """
    try:
        yield
    except sqlite3.Error as error:
        raise CampaignError(
            f"{folder}: the campaign cannot be kept ({error}): make room, then continue with --resume"
        ) from error


def columns_of(folder: Path) -> set[str]:
    """Columns of the table of tries; none where `folder` holds no campaign that was completely created."""
    path = folder / DATABASE
    if not path.is_file():
        return set()
    with closing(connected(path)) as connection:
        return {str(row["name"]) for row in connection.execute("PRAGMA table_info(attempts)")}


def connected(path: Path) -> sqlite3.Connection:
    """Open the database; where it cannot be written, to be read.

    Raises:
        CampaignError: it is damaged, or cannot be opened now.
    """
    writable = os.access(path if path.exists() else path.parent, os.W_OK) and os.access(path.parent, os.W_OK)
    try:
        connection = sqlite3.connect(
            path if writable else _to_be_read(path), isolation_level=None, timeout=5.0, uri=not writable
        )
    except sqlite3.OperationalError as error:
        raise _not_opened(path, error) from error
    connection.row_factory = sqlite3.Row
    try:
        if writable:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
        (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.OperationalError as error:  # locked, say: nothing is wrong with the file
        connection.close()
        raise _not_opened(path, error) from error
    except sqlite3.DatabaseError as error:
        found = str(error)
    if found != "ok":
        connection.close()
        raise CampaignError(_damaged(path, found))
    return connection


def _to_be_read(path: Path) -> str:
    """The address of a database on a disk, or of somebody, that lets nobody write: SQLite then makes none of
    the files that it shares with who writes. Where its log is there, somebody may write, or was killed.
    """
    alone = "" if path.with_name(f"{path.name}-wal").exists() else "&immutable=1"
    return f"{path.absolute().as_uri()}?mode=ro{alone}"


def _not_opened(path: Path, error: sqlite3.OperationalError) -> CampaignError:
    return CampaignError(
        f"{path}: cannot be opened ({error}): end what else has it open, or copy the folder to where it can "
        "be written"
    )


def decoded(folder: Path, text: str, what: str, shaped: Callable[[Any], _Shaped]) -> _Shaped:
    """JSON in a cell of the database, as `shaped` takes it. SQLite has no checksum: a wrong bit in a text
    passes its own check.

    Raises:
        CampaignError: it is damaged.
    """
    try:
        content = parsed(text)
    except ValueError as error:
        raise CampaignError(_damaged(folder / DATABASE, f"{what} is not JSON: {error}")) from error
    return understood(folder, content, what, shaped)


def understood(folder: Path, content: Any, what: str, shaped: Callable[[Any], _Shaped]) -> _Shaped:
    """What a cell says, as `shaped` takes it.

    Raises:
        CampaignError: it does not (ValueError, TypeError): none of ours wrote that.
    """
    try:
        return shaped(content)
    except (ValueError, TypeError) as error:
        raise CampaignError(_damaged(folder / DATABASE, f"{what} cannot be {content!r}")) from error


def mapping(content: Any) -> dict[str, Any]:
    """A JSON object.

    Raises:
        TypeError: it is something else.
    """
    if not isinstance(content, dict):
        raise TypeError(content)
    return content


def numbers(content: Any) -> dict[str, Any]:
    """A JSON object of numbers.

    Raises:
        TypeError: it is something else.
    """
    for value in mapping(content).values():
        if not isinstance(value, int | float):
            raise TypeError(value)
    return mapping(content)


def _damaged(path: Path, what: str) -> str:
    return (
        f"{path}: is damaged ({what}): restore it; the records beside it can be read without "
        f"(perchhw log list {path.parent / 'attempts'})"
    )
