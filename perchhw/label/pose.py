"""What an external pose (motion capture) shows of a landing: where the vehicle rests and what touched.

Four feet hold the vehicle level, upside down, one leg height below the ceiling. Two feet let it hang tilted,
its centre of mass below them. The border lies half way between the two tilts that the geometry gives.
"""

from dataclasses import dataclass

import numpy as np

from calibration.flights import Flight
from onboard.arrays import FloatArray
from onboard.rotation import to_matrices
from perchhw.label.evidence import Hold, Touch
from perchhw.label.geometry import LandingGeometry

REST_WINDOW_S = 1.0
"""The last poses of the flight that are averaged: more than one swing on two feet."""
MINIMUM_POSES = 20
DISTANCE_MARGIN_M = 0.04
"""Beyond the two-leg rest distance (hinges, ceiling height, marker frame); a fallen vehicle is far below."""
CONTACT_CLEARANCE_M = 0.003
"""A body point closer to the ceiling than this counts as contact: the accuracy of a good mocap pose."""
_FLIGHT_AFTER_TRIGGER_S = 1.5


@dataclass(frozen=True)
class PoseEvidence:
    """What the pose shows.

    Attributes:
        hold: what holds the vehicle.
        rest_distance_m: body origin below the ceiling at rest (mean over the last second).
        rest_tilt_deg: angle between the inverted b_z and the vertical (deg); 180 is upright.
        tilt_border_deg: border between four-leg and two-leg tilt (deg).
        body_clearance_m: least distance between ceiling and body or propellers after the trigger.
        first_touch: what reached the ceiling first.
    """

    hold: Hold
    rest_distance_m: float
    rest_tilt_deg: float
    tilt_border_deg: float
    body_clearance_m: float
    first_touch: Touch

    @property
    def body_contact(self) -> bool:
        """Whether body or propellers touched the ceiling."""
        return self.body_clearance_m < CONTACT_CLEARANCE_M or self.first_touch is Touch.BODY


def judge_pose(
    flight: Flight, trigger_t: float, geometry: LandingGeometry, ceiling_z: float, settle_s: float
) -> PoseEvidence | None:
    """Judge a triggered flight by its pose; None when no pose shows the vehicle at rest.

    Args:
        flight: with an external pose.
        trigger_t: time of the trigger (s).
        geometry: of the vehicle.
        ceiling_z: height of the ceiling (m).
        settle_s: time after the trigger before which nothing is at rest (s).
    """
    if not flight.has("x", "z", "qw"):
        return None
    t, pose = flight.series("x", "y", "z", "qx", "qy", "qz", "qw")
    rest = (t > flight.t[-1] - REST_WINDOW_S) & (t > trigger_t + settle_s)
    if np.count_nonzero(rest) < MINIMUM_POSES:
        return None
    rotations = to_matrices(pose[:, 3:].copy())
    up = np.mean(rotations[rest, :, 2], axis=0)
    tilt = float(np.degrees(np.arccos(np.clip(-up[2] / np.linalg.norm(up), -1.0, 1.0))))
    distance = float(ceiling_z - np.mean(pose[rest, 2]))
    border = float(np.degrees(geometry.two_leg_tilt) / 2.0)
    flip = (t >= trigger_t) & (t < trigger_t + _FLIGHT_AFTER_TRIGGER_S)
    clearance, touch = _touches(t[flip], pose[flip], geometry, ceiling_z)
    return PoseEvidence(
        hold=_hold(distance, tilt, border, geometry),
        rest_distance_m=distance,
        rest_tilt_deg=tilt,
        tilt_border_deg=border,
        body_clearance_m=clearance,
        first_touch=touch,
    )


def _hold(distance: float, tilt: float, border: float, geometry: LandingGeometry) -> Hold:
    if distance > geometry.two_leg_distance + DISTANCE_MARGIN_M or tilt > 90.0:
        return Hold.NONE
    return Hold.FOUR_LEG if tilt <= border else Hold.TWO_LEG


def _touches(
    t: FloatArray, pose: FloatArray, geometry: LandingGeometry, ceiling_z: float
) -> tuple[float, Touch]:
    """Least body clearance (m) and what reached the ceiling first, between the poses at 1 ms."""
    if t.size < 2:
        return float("inf"), Touch.UNCLEAR
    grid = np.arange(t[0], t[-1], 1e-3)
    signs = np.sign(np.sum(pose[1:, 3:] * pose[:-1, 3:], axis=1))
    continuous = (
        pose[:, 3:] * np.concatenate([[1.0], np.cumprod(np.where(signs == 0.0, 1.0, signs))])[:, None]
    )
    columns = [np.interp(grid, t, pose[:, 2]), *(np.interp(grid, t, continuous[:, k]) for k in range(4))]
    rotations = to_matrices(np.column_stack(columns[1:]))
    body_gap = ceiling_z - columns[0] - geometry.body_top(rotations)
    feet_gap = ceiling_z - columns[0] - geometry.feet_top(rotations)
    first_body = _first_below(body_gap)
    first_feet = _first_below(feet_gap)
    if first_body is None and first_feet is None:
        return float(body_gap.min()), Touch.UNCLEAR
    feet_first = first_body is None or (first_feet is not None and first_feet <= first_body)
    return float(body_gap.min()), Touch.FEET if feet_first else Touch.BODY


def _first_below(gap: FloatArray) -> int | None:
    rows = np.flatnonzero(gap < CONTACT_CLEARANCE_M)
    return int(rows[0]) if rows.size else None
