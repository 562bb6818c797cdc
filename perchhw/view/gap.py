"""The figures of a gap report as a Rerun recording: error curves, residuals, maps and closed-loop flights.

Written to a file; no viewer is started. It shows what ``report.html`` shows
(:class:`calibration.gap.report.ReportFigures`). Horizons and regressors are timelines of their own
(``horizon``, ``regressor``), closed-loop flights are on the timeline ``time``.
"""

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.gap.report import ClosedLoopTrace, GapReport, HeatMap, Lines, ReportFigures, ResidualCloud
from calibration.gap.report.words import headline
from onboard.arrays import FloatArray
from perchhw.record.folder import make_folder
from perchhw.view.rerun_recording import TIMELINE, ViewError

if TYPE_CHECKING:
    import rerun

_APPLICATION = "perchhw_gap"
_ORANGE, _BLUE, _GREY = (210, 105, 30), (32, 103, 176), (107, 116, 128)


def write_gap_rrd(report: GapReport, figures: ReportFigures, out: Path) -> Path:
    """Write the figures as a Rerun recording.

    Args:
        report: its verdict and document are shown as text.
        figures: what is drawn.
        out: the file to write (``.rrd``).

    Returns:
        `out`.

    Raises:
        ViewError: rerun-sdk is not installed.
    """
    if importlib.util.find_spec("rerun") is None:
        raise ViewError("the view needs rerun-sdk: pip install 'perchhw[view]'")
    import rerun as rr

    make_folder(out.parent)
    recording = rr.RecordingStream(_APPLICATION, recording_id=out.stem)
    recording.save(out)
    recording.log("verdict", rr.TextDocument(headline(report)), static=True)
    recording.log("report", rr.TextDocument(report.text()), static=True)
    for panel in figures.horizons:
        curves = dict(panel.stages) if panel.floor is None else {**panel.stages, "floor": panel.floor}
        for name, errors in curves.items():
            _series(recording, f"horizon/{panel.quantity}/{name}", "horizon", panel.horizons, errors)
    for bars in (figures.channels, figures.phases):
        if bars is not None:
            for name, values in bars.stages.items():
                recording.log(f"{bars.title}/{name}", rr.BarChart(np.nan_to_num(values)), static=True)
    if figures.heat_map is not None:
        _heat_map(recording, figures.heat_map)
    for cloud in figures.clouds:
        _cloud(recording, cloud)
    for trace in figures.closed_loop:
        _closed_loop(recording, trace)
    for lines in figures.lines:
        _lines(recording, lines)
    recording.flush()
    recording.disconnect()
    return out


def _series(
    recording: "rerun.RecordingStream", entity: str, timeline: str, at: FloatArray, values: FloatArray
) -> None:
    import rerun as rr

    finite = np.isfinite(values)
    index = rr.TimeColumn(timeline, duration=at[finite])
    recording.send_columns(entity, indexes=[index], columns=rr.Scalars.columns(scalars=values[finite]))


def _heat_map(recording: "rerun.RecordingStream", data: HeatMap) -> None:
    """Channels are rows, regressors columns, as listed in the text beside."""
    import rerun as rr

    names = f"rows: {', '.join(data.channels)}\ncolumns: {', '.join(data.regressors)}\n{data.meaning}"
    recording.log("where/names", rr.TextDocument(names), static=True)
    for name, cells in (("before", data.before), ("after", data.after)):
        tensor = rr.Tensor(np.nan_to_num(cells), dim_names=("channel", "regressor"))
        recording.log(f"where/{name}", tensor, static=True)


def _cloud(recording: "rerun.RecordingStream", data: ResidualCloud) -> None:
    """Every sample as a point, both axes scaled to their range."""
    import rerun as rr

    every = np.concatenate([data.before, data.after])
    height = max(float(np.nanmax(np.abs(every), initial=0.0)), 1e-12)
    width = max(float(np.ptp(data.x)) if data.x.size else 0.0, 1e-12)
    entity = f"residuals/{data.channel} against {data.regressor}"
    for name, values, colour in (("before", data.before, _ORANGE), ("after", data.after, _BLUE)):
        finite = np.isfinite(values) & np.isfinite(data.x)
        points = np.column_stack([data.x / width, -values / height])[finite]  # Rerun's y points down
        recording.log(f"{entity}/{name}", rr.Points2D(points, colors=[colour], radii=0.004), static=True)


def _closed_loop(recording: "rerun.RecordingStream", data: ClosedLoopTrace) -> None:
    at = data.t - data.t[0]
    groups = (
        ("duty", np.where(data.known, data.duty, np.nan), data.needed_duty),
        ("tilt_deg", data.tilt_deg, data.needed_tilt_deg),
    )
    for quantity, measured, needed in groups:
        for name, values in {**needed, "measured": measured}.items():
            _series(recording, f"closed_loop/{data.flight}/{quantity}/{name}", TIMELINE, at, values)


def _lines(recording: "rerun.RecordingStream", data: Lines) -> None:
    """Each curve as a strip, both axes scaled to their range."""
    import rerun as rr

    for name, (x, y) in data.curves.items():
        width, height = (max(float(np.ptp(v)), 1e-12) for v in (x, y))
        strip = np.column_stack([(x - x.min()) / width, (y.max() - y) / height])
        recording.log(
            f"lines/{data.title}/{name}", rr.LineStrips2D([strip], colors=[_GREY], radii=0.002), static=True
        )
