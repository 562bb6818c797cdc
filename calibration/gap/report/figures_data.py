"""What the figures of a report show: plain numbers with names, filled by the search and drawn by the page.

Nothing here is computed and nothing is drawn; every field that is left empty is left out of the page. Stages
are versions of the model in the order in which they are drawn: by convention ``before``, then one per effect
(``+ thrust_scale``), the last with everything that was accepted.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from calibration.errors import CalibrationError
from onboard.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class HorizonCurves:
    """Error against how far ahead, one curve a stage.

    Attributes:
        quantity: such as "position, attitude given".
        unit: of the errors.
        horizons: s, shape (h,).
        stages: errors by stage, each shape (h,).
        floor: what no model could beat, shape (h,); None where it is not known.
    """

    quantity: str
    unit: str
    horizons: FloatArray
    stages: Mapping[str, FloatArray]
    floor: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check the shapes."""
        curves = [*self.stages.values(), *([] if self.floor is None else [self.floor])]
        _same_shape(self.quantity, self.horizons.shape, curves)


@dataclass(frozen=True, kw_only=True)
class StageBars:
    """One number a stage for each of some labels: channels, phases.

    Attributes:
        title: what is compared, such as "by channel".
        unit: of all numbers, such as "share of before".
        labels: shape (k,).
        stages: numbers by stage, each shape (k,); NaN where a label has none.
        floor: shape (k,), or None.
    """

    title: str
    unit: str
    labels: tuple[str, ...]
    stages: Mapping[str, FloatArray]
    floor: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check the shapes."""
        rows = [*self.stages.values(), *([] if self.floor is None else [self.floor])]
        _same_shape(self.title, (len(self.labels),), rows)


@dataclass(frozen=True, kw_only=True)
class ResidualCloud:
    """Residual of a channel against a regressor, before and after; drawn as medians of equal parts.

    Attributes:
        channel, channel_unit: such as "force_z", "m/s2".
        regressor, regressor_unit: such as "battery voltage", "V".
        x: shape (n,). before, after: residuals, shape (n,).
    """

    channel: str
    channel_unit: str
    regressor: str
    regressor_unit: str
    x: FloatArray
    before: FloatArray
    after: FloatArray

    def __post_init__(self) -> None:
        """Check the shapes."""
        _same_shape(f"{self.channel} against {self.regressor}", self.x.shape, [self.before, self.after])


@dataclass(frozen=True, kw_only=True)
class HeatMap:
    """Where the gap lives: channels against regressors, before and after.

    Attributes:
        meaning: what a cell is, such as "share of the residual's variance that goes with the regressor".
        channels: rows, shape (r,). regressors: columns, shape (c,).
        before, after: shape (r, c), 0 to 1; NaN where it cannot be said.
        chance: shape (r, c) or None: what the colour of the noise alone reaches in 95 % of cases; cells below
            it are drawn faint.
    """

    meaning: str
    channels: tuple[str, ...]
    regressors: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    chance: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check the shapes."""
        cells = [self.before, self.after, *([] if self.chance is None else [self.chance])]
        _same_shape("heat map", (len(self.channels), len(self.regressors)), cells)


@dataclass(frozen=True, kw_only=True)
class ClosedLoopTrace:
    """A held-out flight that the model flew again along the measured path.

    Attributes:
        flight: its name.
        t: s, shape (n,).
        known: where the measured commands are known, shape (n,).
        duty: mean of the four motors, measured, shape (n,). needed_duty: by stage, each shape (n,).
        tilt_deg: angle between body axis and vertical, measured, shape (n,). needed_tilt_deg: by stage.
    """

    flight: str
    t: FloatArray
    known: BoolArray
    duty: FloatArray
    needed_duty: Mapping[str, FloatArray]
    tilt_deg: FloatArray
    needed_tilt_deg: Mapping[str, FloatArray]

    def __post_init__(self) -> None:
        """Check the shapes."""
        rows = [self.duty, self.tilt_deg, *self.needed_duty.values(), *self.needed_tilt_deg.values()]
        _same_shape(self.flight, self.t.shape, rows)


@dataclass(frozen=True, kw_only=True)
class ReportFigures:
    """All figures of a report; what is empty or None is left out.

    Attributes:
        horizons: one panel each.
        channels, phases: bars by channel and by phase of flight.
        heat_map: where the gap lives.
        clouds: residuals against regressors, most telling first.
        closed_loop: held-out flights that the model flew again.
    """

    horizons: tuple[HorizonCurves, ...] = ()
    channels: StageBars | None = None
    phases: StageBars | None = None
    heat_map: HeatMap | None = None
    clouds: tuple[ResidualCloud, ...] = ()
    closed_loop: tuple[ClosedLoopTrace, ...] = ()


def _same_shape(name: str, shape: tuple[int, ...], arrays: list[FloatArray]) -> None:
    for array in arrays:
        if array.shape != shape:
            raise CalibrationError(f"figure {name!r}: an array has shape {array.shape}, expected {shape}")
