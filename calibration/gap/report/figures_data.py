"""What the figures of a report show: plain numbers with names, filled by the search and drawn by the page.

Nothing here is computed and nothing is drawn; every field that is left empty is left out of the page. Stages
are versions of the model in the order in which they are drawn: by convention ``before``, then one per effect
(``+ thrust_scale``), the last with everything that was accepted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from calibration.gap.replay.closed_loop import ClosedLoopFlight
from calibration.gap.report.document import Gap
from calibration.gap.unnamed.gap_map import GapMap
from onboard.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class AlongRegressor:
    """Two readings of a channel along a regressor; drawn as medians of equal parts.

    Attributes:
        channel, channel_unit: such as "force_z", "m/s2".
        regressor, regressor_unit: such as "battery voltage", "V".
        x: shape (n,). first, second: residuals before and after, or what the data show of an effect beyond a
            model without it and what it says; shape (n,).
        effect: its name; empty for residuals.
    """

    channel: str
    channel_unit: str
    regressor: str
    regressor_unit: str
    x: FloatArray
    first: FloatArray
    second: FloatArray
    effect: str = ""


@dataclass(frozen=True, kw_only=True)
class ReportFigures:
    """All figures of a report; what is empty or None is left out.

    Attributes:
        stages: the gap of each stage, held against the first.
        heat_map: where the residual lived before, and lives after.
        clouds: residuals against regressors, most telling first.
        closed_loop: a held-out flight, flown again by the models of some stages.
    """

    effects: tuple[AlongRegressor, ...] = ()
    stages: Mapping[str, Gap] = field(default_factory=dict)
    heat_map: tuple[GapMap, GapMap] | None = None
    clouds: tuple[AlongRegressor, ...] = ()
    closed_loop: Mapping[str, ClosedLoopFlight] = field(default_factory=dict)
