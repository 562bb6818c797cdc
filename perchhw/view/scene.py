"""The room with the drone in it: cage, ceiling, vehicle with legs, where it is and where it is going.

World frame, m (ENU, z up). Nothing is known of a room but its walls and its ceiling, so no more is drawn.
"""

import itertools
from typing import Any

import numpy as np

from calibration.flights.run_folder import RunRecord
from calibration.flights.series_file import Series
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachPlan, sample_approach
from onboard.vehicle import Vehicle
from perchhw.label import landing_geometry
from perchhw.view.palette import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION
from perchhw.view.timeline import Canvas

DRONE = "room/drone"
BESIDE = "room/beside"
"""Goes along with the drone without turning: where it is seen from near."""
_REFERENCE_STEP_S = 0.02
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
        self._plan = _approach(config)
        self._approach_began: float | None = None
        self._approach_over = False
        self._trail_until = -np.inf
        self._poses = (np.empty(0), np.empty((0, 3)))
        canvas.static("room", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        room = _room(config)
        if room is not None:
            _draw_room(canvas, room)
        _draw_vehicle(canvas, vehicle)
        if self._plan is not None:
            _draw_reference(canvas, self._plan)
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


def _approach(config: dict[str, Any]) -> ApproachPlan | None:
    given = config.get("approach")
    if not isinstance(given, dict) or given.keys() != set(ApproachPlan._fields):
        return None
    return ApproachPlan(**{name: float(value) for name, value in given.items()})


def _room(config: dict[str, Any]) -> RoomGeometry | None:
    given = config.get("room")
    if isinstance(given, dict) and given.keys() == set(RoomGeometry.__dataclass_fields__):
        return RoomGeometry(**{name: float(value) for name, value in given.items()})
    ceiling_z = config.get("ceiling_z")
    return None if ceiling_z is None else RoomGeometry(ceiling_z=float(ceiling_z))


def _draw_room(canvas: Canvas, room: RoomGeometry) -> None:
    """The cage as lines, floor and ceiling as planes; the ceiling with its tilt."""
    import rerun as rr

    corners = [(x, y) for x, y in itertools.product((room.x_min, room.x_max), (room.y_min, room.y_max))]
    floor = [(x, y, room.floor_z) for x, y in corners]
    ceiling = [(x, y, room.ceiling_at(x, y)) for x, y in corners]
    around = (0, 1, 3, 2, 0)
    strips = [[low, high] for low, high in zip(floor, ceiling, strict=True)]
    strips += [[level[i] for i in around] for level in (floor, ceiling)]
    canvas.static("room/cage", rr.LineStrips3D(strips, colors=[GREY], radii=0.006))
    for name, plane, colour in (("ceiling", ceiling, (*BLUE, 70)), ("floor", floor, (*GREY, 40))):
        mesh = rr.Mesh3D(
            vertex_positions=plane, triangle_indices=[[0, 1, 3], [0, 3, 2]], albedo_factor=colour
        )
        canvas.static(f"room/{name}", mesh)


def _draw_reference(canvas: Canvas, plan: ApproachPlan) -> None:
    """The path of the approach from its start to the impact point."""
    import rerun as rr

    times = np.arange(0.0, plan.impact_time + _REFERENCE_STEP_S, _REFERENCE_STEP_S)
    path = [sample_approach(plan, min(float(t), plan.impact_time))[0] for t in times]
    canvas.static("room/reference_path", rr.LineStrips3D([path], colors=[ORANGE], radii=0.005))


def _draw_vehicle(canvas: Canvas, vehicle: Vehicle) -> None:
    """Arms, propellers and legs, in the body frame (FLU); the front is coloured."""
    import rerun as rr

    body = vehicle.body
    motors = np.array(
        [
            (sx * body.arm_x.value, sy * body.arm_y.value, body.propeller_height_z.value)
            for sx, sy in ((1, -1), (-1, -1), (-1, 1), (1, 1))
        ]
    )
    arms = rr.LineStrips3D([[motors[0], motors[2]], [motors[1], motors[3]]], colors=[GREY], radii=0.003)
    canvas.static(f"{DRONE}/arms", arms)
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    rim = body.propeller_radius.value * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(33)])
    rims = rr.LineStrips3D(
        [rim + motor for motor in motors], colors=[VERMILION, GREY, GREY, VERMILION], radii=0.0015
    )
    canvas.static(f"{DRONE}/propellers", rims)
    legs = vehicle.legs
    if legs is None:
        return
    feet = landing_geometry(vehicle).feet
    sides = np.sign(feet[:, :2]) * (legs.hip_x.value, legs.hip_y.value)
    hips = np.column_stack([sides, np.full(4, legs.hip_z.value)])
    strips = [[hip, foot] for hip, foot in zip(hips, feet, strict=True)]
    canvas.static(f"{DRONE}/legs", rr.LineStrips3D(strips, colors=[GREEN], radii=0.002))
    canvas.static(f"{DRONE}/feet", rr.Points3D(feet, colors=[GREEN], radii=legs.foot_radius.value))
