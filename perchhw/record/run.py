"""A run as notebooks and commands read it: its record, and all channels as one table."""

from pathlib import Path
from typing import TYPE_CHECKING

from onboard.record.run_record import RunRecord

if TYPE_CHECKING:
    import pandas


class Run(RunRecord):
    """A run as read back."""

    def to_pandas(self, rate_hz: float | None = None) -> "pandas.DataFrame":
        """All channels as a table with the time (s, on the run's clock) as index.

        Args:
            rate_hz: of one clock for all channels (:mod:`calibration.flights.resample`); None: the rows as
                they were received, each with what it brought.

        Returns:
            A column a channel, NaN where there is no value; ``attrs["units"]`` has the units by column.

        Raises:
            RunFolderError: pandas is not installed.
            UnusableFlightError: no message in the record.
            ResampleError: not a rate.
        """
        from calibration.flights.data_frame import data_frame

        return data_frame(self, rate_hz)


def read_run(folder: str | Path) -> Run:
    """Read the run `folder`; a torn tail is left out and named in :attr:`Run.torn`.

    Raises:
        RunFolderError: no run folder, damaged elsewhere than at the end, or not ours to read.
    """
    return Run.read(folder)
