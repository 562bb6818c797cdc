"""The calendar's time of what is in a record, whose own clock begins anywhere."""

from collections.abc import Callable
from datetime import datetime

from calibration.flights.run_folder import RunFolderError, RunRecord

NANOSECOND = 1_000_000_000


def wall_clock(run: RunRecord) -> Callable[[float], int]:
    """A function from the run's clock (s) to nanoseconds since 1970, UTC.

    Raises:
        RunFolderError: ``run.json`` does not say when the run began.
    """
    try:
        started = datetime.fromisoformat(run.info["started_utc"]).timestamp()
        begin = started - float(run.info["clock_at_start"])
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(
            f"{run.folder / 'run.json'} keys started_utc and clock_at_start: no time of the calendar "
            f"({error!r}); export to csv or parquet, which need none"
        ) from error
    return lambda t: round(NANOSECOND * (begin + t))
