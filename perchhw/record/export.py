"""Export a run to files for other tools: one table per topic, and the whole flight as one table."""

import csv
import importlib
import importlib.util
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.perchhw_run import flight_from_run
from calibration.flights.run_folder import RunRecord, Series
from onboard.errors import InputError
from perchhw.errors import FlightStackError
from perchhw.record.folder import make_folder
from perchhw.record.foxglove import write_foxglove
from perchhw.record.ros2_bag import write_ros2_bag

Table = tuple[list[str], Iterable[Sequence[Any]]]


class ExportFormat(StrEnum):
    """File formats of an export."""

    CSV = "csv"
    PARQUET = "parquet"
    ROS2 = "ros2"
    FOXGLOVE = "foxglove"


class ExportError(FlightStackError, InputError):
    """The export cannot be made; the message says what to install or change."""


def export_run(run: RunRecord, out: Path, format: ExportFormat) -> list[Path]:
    """Write `run` into the folder `out` and give the files.

    ``<topic>.<format>`` holds the messages of a topic (``t`` in s on the run's clock, then its fields).
    ``flight.<format>`` holds all channels on one time column, empty where a channel has no sample; as CSV it
    is of the flight format ``table``. With ``ros2`` or ``foxglove`` it is one MCAP file.

    Raises:
        ExportError: Parquet without pyarrow.
        OutputFolderError: `out` cannot be written.
    """
    if format is ExportFormat.ROS2:
        return [write_ros2_bag(run, out)]
    if format is ExportFormat.FOXGLOVE:
        return [write_foxglove(run, out)]
    write = _writer(format)
    make_folder(out)
    written = []
    for series in run.series.values():
        path = out / f"{series.topic}.{format}"
        write(path, *_topic_table(series))
        written.append(path)
    try:
        flight = flight_from_run(run)
    except UnusableFlightError:
        return written
    path = out / f"flight.{format}"
    write(path, *_flight_table(flight))
    return [*written, path]


def _writer(format: ExportFormat) -> Callable[[Path, list[str], Iterable[Sequence[Any]]], None]:
    if format is ExportFormat.CSV:
        return _write_csv
    if importlib.util.find_spec("pyarrow") is None:
        raise ExportError("Parquet needs pyarrow: pip install 'perchhw[parquet]', or export with --to csv")
    return _write_parquet


def _topic_table(series: Series) -> Table:
    names = list(dict.fromkeys(name for message in series.messages for name in message))
    rows = (
        [float(t), *(message.get(name) for name in names)]
        for t, message in zip(series.t, series.messages, strict=True)
    )
    return ["t", *names], rows


def _flight_table(flight: Flight) -> Table:
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
    return ["t", *names], rows


def _write_csv(path: Path, names: list[str], rows: Iterable[Sequence[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        writer.writerows(["" if value is None else value for value in row] for row in rows)


def _write_parquet(path: Path, names: list[str], rows: Iterable[Sequence[Any]]) -> None:
    pyarrow = importlib.import_module("pyarrow")  # optional, and without types
    parquet = importlib.import_module("pyarrow.parquet")
    columns: list[list[Any]] = [[] for _ in names]
    for row in rows:
        for column, value in zip(columns, row, strict=True):
            column.append(float(value) if isinstance(value, int) and not isinstance(value, bool) else value)
    table = pyarrow.table(dict(zip(names, (pyarrow.array(c) for c in columns), strict=True)))
    parquet.write_table(table, path)
