"""How a view opens: the room beside the optical-flow space, what happened, and the plots in tabs."""

from typing import TYPE_CHECKING

from perchhw.view.plots import PANELS, Panel
from perchhw.view.scene import BESIDE
from perchhw.view.timeline import TIMELINE

if TYPE_CHECKING:
    import rerun.blueprint

_TRAIL_S = 30.0
"""How much of the path stays visible, s."""
_ESTIMATE_S = 1.0
_TABS = (
    ("cues", ("tau", "theta_x", "d_ceil", "policy")),
    ("motion", ("rates", "velocity", "estimate_error")),
    ("machine", ("motors", "battery", "link")),
)


def make_blueprint() -> "rerun.blueprint.Blueprint":
    """Room, drone from near and log on the left; optical-flow space and plots in tabs on the right."""
    import rerun.blueprint as rrb

    panels = {panel.name: panel for panel in PANELS}
    tabs = [rrb.Vertical(*(_plot(panels[name]) for name in names), name=title) for title, names in _TABS]
    room = rrb.Spatial3DView(
        origin="room",
        name="room [m], with where it is and where it is going",
        overrides={"room/trail": _last(_TRAIL_S), "room/estimate": _last(_ESTIMATE_S)},
        eye_controls=rrb.EyeControls3D(position=(-3.5, -5.0, 2.2), look_target=(-1.2, 0.0, 1.2)),
    )
    cue_space = rrb.Spatial3DView(
        origin="cue_space",
        name="tau [s], theta_x [1/s], d_ceil [m]: it fires between the faces",
        overrides={"cue_space/trail": _last(_TRAIL_S)},
        eye_controls=rrb.EyeControls3D(position=(1.5, -1.1, 1.2), look_target=(0.45, 0.45, 0.4)),
    )
    close = rrb.Spatial3DView(
        origin=BESIDE,
        contents="room/**",
        name="drone [m], from near",
        overrides={"room/trail": _last(_TRAIL_S), "room/estimate": _last(_ESTIMATE_S)},
        eye_controls=rrb.EyeControls3D(position=(-0.3, -0.45, 0.05), look_target=(0.0, 0.0, 0.0)),
    )
    events = rrb.TextLogView(origin="events", name="what happened")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(room, close, events, row_shares=[3, 3, 2]),
            rrb.Vertical(cue_space, rrb.Tabs(*tabs), row_shares=[2, 3]),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        collapse_panels=True,
        auto_views=False,
    )


def _last(seconds: float) -> "list[rerun.blueprint.VisibleTimeRanges]":
    """What came within the last `seconds` stays visible."""
    import rerun.blueprint as rrb

    since = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return [rrb.VisibleTimeRanges([since])]


def _plot(panel: Panel) -> "rerun.blueprint.TimeSeriesView":
    import rerun.blueprint as rrb

    axis = rrb.ScalarAxis(range=panel.limits) if panel.limits else None
    return rrb.TimeSeriesView(origin=f"plots/{panel.name}", name=panel.title, axis_y=axis)
