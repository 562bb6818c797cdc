"""When a record began: on its own clock, and on the calendar."""

from collections.abc import Callable
from datetime import datetime

from onboard.record.run_record import RunFolderError, RunRecord
from onboard.record.series_file import REMEDY

NANOSECOND = 1_000_000_000
_CLOCK_MAX_S = 1e9
_CALENDAR_MAX_S = 2**31
"""Seconds since 1970 that all formats can hold; until 2038."""


def begin_of(run: RunRecord) -> float:
    """The run's clock when the record began, s.

    Raises:
        RunFolderError: ``run.json`` does not say.
    """
    begin = run.info.get("clock_at_start")
    if isinstance(begin, bool) or not isinstance(begin, int | float) or not 0.0 <= begin < _CLOCK_MAX_S:
        raise RunFolderError(
            f"{run.folder / 'run.json'} key 'clock_at_start': {begin!r} is no time: {REMEDY}"
        )
    return float(begin)


def wall_clock(run: RunRecord) -> Callable[[float], int]:
    """A function from the run's clock (s) to nanoseconds since 1970, UTC.

    Raises:
        RunFolderError: ``run.json`` does not say when the run began.
    """
    begin, started = begin_of(run), run.info.get("started_utc")
    try:
        calendar = datetime.fromisoformat(str(started)).timestamp()
    except (ValueError, OverflowError) as error:
        raise RunFolderError(
            f"{run.folder / 'run.json'} key 'started_utc': {started!r} is no date: {REMEDY}"
        ) from error
    if not 0.0 <= calendar < _CALENDAR_MAX_S:
        raise RunFolderError(
            f"{run.folder / 'run.json'} key 'started_utc': {started!r} is not from 1970 to 2037: {REMEDY}"
        )
    return lambda t: round(NANOSECOND * (calendar + (t - begin)))
