"""Export a run to files for other tools: one table per topic, and the whole flight as one table."""

import csv
import importlib
import importlib.util
import math
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.flight import CHANNELS
from calibration.flights.perchhw_run import flight_from_run
from calibration.flights.resample import GAP_PERIODS, RATE_HZ, Resampled, resample
from onboard.errors import InputError
from onboard.record.folder import OutputFolderError, make_folder
from onboard.record.run_record import RunRecord, Series
from onboard.record.topics import TOPICS
from perchhw.errors import FlightStackError
from perchhw.record.foxglove import write_foxglove
from perchhw.record.ros2_bag import write_ros2_bag


class Column(NamedTuple):
    """A column of a table: its name, unit and meaning."""

    name: str
    unit: str
    meaning: str


class ExportTable(NamedTuple):
    """Columns and rows, and what is to be said of the whole."""

    columns: list[Column]
    rows: Iterable[Sequence[Any]]
    about: dict[str, str]


_TIME = Column("t", "s", "time on the run's clock")
_CLOCK = {"clock": "the run's monotonic clock; run.json has clock_at_start beside started_utc"}


class ExportFormat(StrEnum):
    """File formats of an export."""

    CSV = "csv"
    PARQUET = "parquet"
    ROS2 = "ros2"
    FOXGLOVE = "foxglove"


class ExportError(FlightStackError, InputError):
    """The export cannot be made; the message says what to install or change."""


def export_run(run: RunRecord, out: Path, format: ExportFormat, rate_hz: float = RATE_HZ) -> list[Path]:
    """Write `run` into the folder `out` and give the files.

    ``<topic>.<format>`` holds the messages of a topic (``t`` in s on the run's clock, then its fields).
    ``flight.<format>`` holds all channels on one time column, empty where a channel has no sample; as CSV it
    is of the flight format ``table``. ``resampled.<format>`` is the same on one clock of `rate_hz`
    (:mod:`calibration.flights.resample`). Columns of Parquet carry ``unit`` and ``meaning``. With ``ros2`` or
    ``foxglove`` it is one MCAP file.

    Raises:
        ExportError: Parquet without pyarrow.
        ResampleError: not a rate.
        OutputFolderError: `out` cannot be written.
    """
    try:
        return _written(run, out, format, rate_hz)
    except OSError as error:
        raise OutputFolderError(out, error.strerror or str(error)) from error


def _written(run: RunRecord, out: Path, format: ExportFormat, rate_hz: float) -> list[Path]:
    if format is ExportFormat.ROS2:
        return [write_ros2_bag(run, out)]
    if format is ExportFormat.FOXGLOVE:
        return [write_foxglove(run, out)]
    write = _writer(format)
    make_folder(out)
    written = []
    for series in run.series.values():
        path = out / f"{series.topic}.{format}"
        write(path, _topic_table(series))
        written.append(path)
    try:
        flight = flight_from_run(run)
    except UnusableFlightError:
        return written
    whole, resampled = out / f"flight.{format}", out / f"resampled.{format}"
    write(whole, _flight_table(flight))
    write(resampled, _resampled_table(resample(flight, rate_hz)))
    return [*written, whole, resampled]


def _writer(format: ExportFormat) -> Callable[[Path, ExportTable], None]:
    if format is ExportFormat.CSV:
        return _write_csv
    if importlib.util.find_spec("pyarrow") is None:
        raise ExportError("Parquet needs pyarrow: pip install 'perchhw[parquet]', or export with --to csv")
    return _write_parquet


def _topic_table(series: Series) -> ExportTable:
    names = list(dict.fromkeys(name for message in series.messages for name in message))
    rows = (
        [float(t), *(message.get(name) for name in names)]
        for t, message in zip(series.t, series.messages, strict=True)
    )
    fields = {field.name: field for field in TOPICS[series.topic].fields} if series.topic in TOPICS else {}
    columns = [
        Column(name, fields[name].unit, fields[name].meaning) if name in fields else Column(name, "", "")
        for name in names
    ]
    return ExportTable([_TIME, *columns], rows, _CLOCK)


def _flight_table(flight: Flight) -> ExportTable:
    names = list(flight.data)
    columns = [flight.data[name] for name in names]
    valid = [flight.valid[name] for name in names]
    rows = (
        [
            float(flight.t[i]),
            *(float(c[i]) if v[i] else None for c, v in zip(columns, valid, strict=True)),
        ]
        for i in range(flight.t.size)
    )
    return ExportTable([_TIME, *_channels(names)], rows, _CLOCK)


def _resampled_table(resampled: Resampled) -> ExportTable:
    columns = list(resampled.data.values())
    rows = (
        [float(t), *(None if math.isnan(c[i]) else float(c[i]) for c in columns)]
        for i, t in enumerate(resampled.t)
    )
    rule = f"linear between a channel's samples, none where they are more than {GAP_PERIODS:g} periods apart"
    about = {**_CLOCK, "rate_hz": f"{resampled.rate_hz:g}", "interpolation": rule}
    return ExportTable([_TIME, *_channels(list(resampled.data))], rows, about)


def _channels(names: list[str]) -> list[Column]:
    return [Column(name, CHANNELS[name].unit, CHANNELS[name].meaning) for name in names]


def _write_csv(path: Path, table: ExportTable) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow([column.name for column in table.columns])
        writer.writerows(["" if value is None else value for value in row] for row in table.rows)


def _write_parquet(path: Path, table: ExportTable) -> None:
    pyarrow = importlib.import_module("pyarrow")  # optional, and without types
    parquet = importlib.import_module("pyarrow.parquet")
    values: list[list[Any]] = [[] for _ in table.columns]
    for row in table.rows:
        for into, value in zip(values, row, strict=True):
            into.append(float(value) if isinstance(value, int) and not isinstance(value, bool) else value)
    arrays = [pyarrow.array(column) for column in values]
    fields = [
        pyarrow.field(column.name, array.type, metadata={"unit": column.unit, "meaning": column.meaning})
        for column, array in zip(table.columns, arrays, strict=True)
    ]
    schema = pyarrow.schema(fields, metadata=table.about)
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=schema), path)
