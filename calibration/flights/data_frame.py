"""A run as a table of pandas."""

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from calibration.flights.flight import CHANNELS
from calibration.flights.perchhw_run import flight_from_run
from calibration.flights.resample import resample
from onboard.record.run_record import RunFolderError, RunRecord

if TYPE_CHECKING:
    import pandas


def data_frame(run: RunRecord, rate_hz: float | None) -> "pandas.DataFrame":
    """As :meth:`perchhw.record.run.Run.to_pandas`."""
    if importlib.util.find_spec("pandas") is None:
        raise RunFolderError(f"{run.folder}: a table of pandas needs pandas: pip install 'perchhw[parquet]'")
    import pandas

    flight = flight_from_run(run)
    if rate_hz is None:
        t = flight.t
        columns = {name: np.where(flight.valid[name], flight.data[name], np.nan) for name in flight.data}
    else:
        resampled = resample(flight, rate_hz)
        t, columns = resampled.t, resampled.data
    table = pandas.DataFrame(columns, index=pandas.Index(t, name="t"))
    table.attrs["units"] = {"t": "s", **{name: CHANNELS[name].unit for name in columns}}
    return table
