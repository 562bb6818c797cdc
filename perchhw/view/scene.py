"""The room with the drone in it: cage, ceiling, vehicle with legs, where it is and where it is going.

World frame, m (ENU, z up). Nothing is known of a room but its walls and its ceiling, so no more is drawn.
"""

from typing import Any

import numpy as np

from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.record.run_record import RunRecord
from onboard.record.series_file import Series
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachPlan, sample_approach
from onboard.vehicle import Vehicle
from perchhw.record.palette import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION
from perchhw.record.shapes import (
    approach_of,
    approach_path,
    cage_shape,
    room_of,
    vehicle_shape,
)
from perchhw.view.timeline import Canvas

DRONE = "room/drone"
BESIDE = "room/beside"
"""Goes along with the drone without turning: where it is seen from near."""
_TRAIL_STEP_S = 0.02
_AFTER_TRIGGER = frozenset(LandingState) - {
    LandingState.IDLE,
    LandingState.TRAJECTORY_ARMED,
    LandingState.APPROACH,
}


class Scene:
    """Draws a run's room, and moves its drone.

    Args:
        canvas: where it is drawn.
        config: of the run: ``room``, ``approach``, ``ceiling_z``; what is missing is not drawn.
        vehicle: its geometry is drawn.
    """

    def __init__(self, canvas: Canvas, config: dict[str, Any], vehicle: Vehicle) -> None:
        import rerun as rr

        self._canvas = canvas
        self._plan = approach_of(config)
        self._approach_began: float | None = None
        self._approach_over = False
        self._trail_until = -np.inf
        self._poses = (np.empty(0), np.empty((0, 3)))
        canvas.static("room", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        room = room_of(config)
        if room is not None:
            _draw_room(canvas, room)
        _draw_vehicle(canvas, vehicle)
        if self._plan is not None:
            path = rr.LineStrips3D([approach_path(self._plan)], colors=[ORANGE], radii=0.005)
            canvas.static("room/reference_path", path)
        for entity, colour, radius in (
            ("room/trail", BLUE, 0.004),
            ("room/estimate", PURPLE, 0.005),
            ("room/target", ORANGE, 0.025),
            ("room/trigger", VERMILION, 0.03),
        ):
            canvas.static(entity, rr.Points3D.from_fields(colors=[colour], radii=[radius]))

    def add(self, news: RunRecord) -> None:
        """Move what the new messages move."""
        self._move(news.series.get("pose"))
        estimate = news.series.get("estimate")
        if estimate is not None:
            t, position = _rows(estimate, "x", "y", "z")
            self._canvas.trail("room/estimate", t, position)
        cues = news.series.get("cues")
        if cues is not None and self._plan is not None:
            self._aim(cues, self._plan)

    def _move(self, pose: Series | None) -> None:
        import rerun as rr

        if pose is None:
            return
        t, rows = _rows(pose, "x", "y", "z", "qx", "qy", "qz", "qw")
        self._poses = (np.append(self._poses[0][-1:], t), np.vstack([self._poses[1][-1:], rows[:, :3]]))
        columns = rr.Transform3D.columns(translation=rows[:, :3], quaternion=rows[:, 3:])
        self._canvas.columns(DRONE, t, columns)
        self._canvas.columns(BESIDE, t, rr.Transform3D.columns(translation=rows[:, :3]))
        kept = []
        for i, time in enumerate(t):
            if time >= self._trail_until:
                self._trail_until = time + _TRAIL_STEP_S
                kept.append(i)
        self._canvas.trail("room/trail", t[kept], rows[kept, :3])

    def _aim(self, cues: Series, plan: ApproachPlan) -> None:
        """The reference of the moment: the approach's start until it begins, then the point on its path."""
        times, targets = [], []
        for t, state in zip(cues.t, cues.numbers("state"), strict=True):
            if self._approach_over or np.isnan(state):
                continue
            if state in _AFTER_TRIGGER:
                self._approach_over = True
                self._canvas.cleared("room/target", float(t))
                times_seen, places = self._poses
                before = int(np.searchsorted(times_seen, t, side="right")) - 1
                if state != LandingState.FAULT and before >= 0:
                    self._canvas.trail("room/trigger", np.array([t]), places[before : before + 1])
                continue
            if state == LandingState.APPROACH and self._approach_began is None:
                self._approach_began = float(t)
            since = 0.0 if self._approach_began is None else float(t) - self._approach_began
            times.append(t)
            targets.append(sample_approach(plan, since)[0])
        self._canvas.trail("room/target", np.array(times), np.array(targets).reshape(-1, 3))


def _rows(series: Series, *names: str) -> tuple[FloatArray, FloatArray]:
    """Times (n,) and values (n, names) of the messages that bring all of `names`."""
    rows = np.column_stack([series.numbers(name) for name in names])
    known = ~np.isnan(rows).any(axis=1)
    return series.t[known], rows[known]


def _draw_room(canvas: Canvas, room: RoomGeometry) -> None:
    import rerun as rr

    cage = cage_shape(room)
    canvas.static("room/cage", rr.LineStrips3D(cage.edges, colors=[GREY], radii=0.006))
    for name, plane, colour in (("ceiling", cage.ceiling, (*BLUE, 70)), ("floor", cage.floor, (*GREY, 40))):
        mesh = rr.Mesh3D(vertex_positions=plane, triangle_indices=cage.triangles, albedo_factor=colour)
        canvas.static(f"room/{name}", mesh)


def _draw_vehicle(canvas: Canvas, vehicle: Vehicle) -> None:
    """The front is coloured."""
    import rerun as rr

    shape = vehicle_shape(vehicle)
    canvas.static(f"{DRONE}/arms", rr.LineStrips3D(shape.arms, colors=[GREY], radii=0.003))
    rims = rr.LineStrips3D(shape.rims, colors=[VERMILION, GREY, GREY, VERMILION], radii=0.0015)
    canvas.static(f"{DRONE}/propellers", rims)
    if shape.legs:
        canvas.static(f"{DRONE}/legs", rr.LineStrips3D(shape.legs, colors=[GREEN], radii=0.002))
        canvas.static(f"{DRONE}/feet", rr.Points3D(shape.feet, colors=[GREEN], radii=shape.foot_radius))
