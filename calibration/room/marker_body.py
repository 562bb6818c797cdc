"""Where the drone's body sits in the tracked subject: from rests on a plate, then from a flight.

A subject is seen at p with attitude R (subject to world). Sought are t, the body's origin in the axes of the
subject, and Q, from the axes of the body to those of the subject:

    p_body = p + R t,   R_body = R Q

**Two rests** on one plate, the body's centre over one mark, turned about the plate's normal n in between:

    R1 b = R2 b = n,  b = Q e_z              so b is the axis of R1' R2, whatever the plate's tilt
    (R1 - R2) t = p2 - p1                    for the part of t across b, whatever the place
    n . (p + R t) = n . (plate under it) + h for the part along b, h: the body's origin above the plate

Both amplify errors by 1 / (2 sin(d/2)), d the angle between the headings: half a turn is best. The heading of
the body in the subject is that of a drone whose nose points along the world's x axis in the first rest, to
within some degrees.

**A flight** of small quick tilts then shows what is left, from gyro and accelerometer against the poses
(:mod:`calibration.gap.sensors`): seen attitude = true exp(r), seen place = true + R_body o, hence

    Q <- Q exp(-r),   t <- t - Q o

Both are joined by their covariances (Aitken 1935).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.room.errors import GeometryRefused
from onboard.arrays import FloatArray

HEADINGS_APART_DEG = 60.0
"""deg between the headings of two rests, at least: errors are amplified by 1.0 there, by 0.5 at 180."""
LEVEL_DEG = 5.0
"""deg that a plate may tilt against the world's z axis."""
MOVED_M, TURNED_RAD = 1e-3, 4e-3
"""Standard deviation of the place (m) and of the attitude (rad) of a drone that rests; good rooms show 0.02
mm and 0.2 mrad."""
FEET_RAD = 2e-3
"""rad, standard uncertainty of feet that stand: 0.2 mm over 0.1 m."""
NOSE_RAD = math.radians(5.0)
"""rad, standard uncertainty of a nose that is turned along x by eye."""
BOARD_M = 1.5e-3
"""m, standard uncertainty of the place of the inertial sensor in the body, which no vehicle file says."""


@dataclass(frozen=True)
class Rest:
    """A subject that rests, as motion capture sees it.

    Attributes:
        position: m, mean, world, (3,).
        attitude: mean, subject to world.
        place_scatter, attitude_scatter: standard deviation of one sample, m and rad.
        samples: how many.
    """

    position: FloatArray
    attitude: Rotation
    place_scatter: float
    attitude_scatter: float
    samples: int

    @classmethod
    def of(cls, positions: FloatArray, quaternions: FloatArray) -> "Rest":
        """From samples, (n, 3) and (n, 4) scalar-last.

        Raises:
            GeometryRefused: fewer than two, or the subject moved.
        """
        if len(positions) < 2:
            raise GeometryRefused("too few poses of the subject: is it in sight of the cameras?")
        attitudes = Rotation.from_quat(quaternions)
        mean = attitudes.mean()
        turns = (mean.inv() * attitudes).as_rotvec()
        place = float(positions.std(axis=0).max())
        attitude = float(np.sqrt((turns**2).mean(axis=0)).max())
        if place > MOVED_M or attitude > TURNED_RAD:
            raise GeometryRefused(
                f"the subject moved while it rested, by {1e3 * place:.1f} mm and {math.degrees(attitude):.2f}"
                " deg (standard deviations): let go of it, and do the step again"
            )
        return cls(positions.mean(axis=0), mean, place, attitude, len(positions))


@dataclass(frozen=True)
class Standing:
    """How the drone stands.

    Attributes:
        height, height_sigma: of the body's origin above the plate, m.
        plate, plate_sigma: of the plate above z = 0 of the world, m.
        placed_sigma: m along x and y, how well the body's centre is put over the mark.
    """

    height: float
    height_sigma: float
    plate: float = 0.0
    plate_sigma: float = 1e-3
    placed_sigma: float = 1e-3


@dataclass(frozen=True)
class MarkerBody:
    """Where the body sits in the subject.

    Attributes:
        position: t, m, (3,); its covariance in `position_covariance`, axes of the subject.
        rotation: Q; `rotation_covariance`, rad2, of small turns about the axes of the body.
        plate_tilt_deg: of the plate against the world's z axis.
    """

    position: FloatArray
    rotation: Rotation
    position_covariance: FloatArray
    rotation_covariance: FloatArray
    plate_tilt_deg: float


def from_rests(first: Rest, second: Rest, standing: Standing) -> MarkerBody:
    """From two rests; the nose points along the world's x axis in the first.

    Raises:
        GeometryRefused: the headings are too much alike, the drone was tilted in between, or the plate is not
            level.
    """
    turn = (first.attitude.inv() * second.attitude).as_rotvec()
    apart = float(np.linalg.norm(turn))
    if apart < math.radians(HEADINGS_APART_DEG):
        raise GeometryRefused(
            f"the headings of the two rests are {math.degrees(apart):.0f} deg apart and must be "
            f"{HEADINGS_APART_DEG:g} at least: turn the drone by half a turn on the plate, and rest again"
        )
    up = turn / apart  # b in the axes of the subject, or -b
    normal = first.attitude.apply(up)
    if normal[2] < 0.0:
        up, normal = -up, -normal
    tilt = math.degrees(math.acos(min(1.0, float(normal[2]))))
    if tilt > LEVEL_DEG:
        raise GeometryRefused(
            f"between the rests the drone was turned about an axis {tilt:.1f} deg from the vertical: stand "
            "it on a level plate both times, all feet down"
        )
    rotation = _heading_along_x(up, first.attitude)
    position, position_covariance = _position(first, second, normal, standing)
    amplified = 1.0 / (2.0 * math.sin(0.5 * apart))
    noise = math.hypot(_of_mean(first.attitude_scatter, first), _of_mean(second.attitude_scatter, second))
    across = math.hypot(amplified * noise, FEET_RAD)
    return MarkerBody(
        position,
        rotation,
        position_covariance,
        np.diag([across**2, across**2, NOSE_RAD**2]),
        tilt,
    )


def joined_with_flight(
    rests: MarkerBody,
    turn: FloatArray,
    turn_covariance: FloatArray,
    offset: FloatArray,
    offset_covariance: FloatArray,
) -> MarkerBody:
    """What the rests said and what a flight with that correction shows of it, by their covariances.

    Args:
        rests: the correction that the flight was flown with.
        turn, turn_covariance: r, rad, (3,) and (3, 3), axes of the body.
        offset, offset_covariance: o, m, likewise.

    Raises:
        GeometryRefused: the two contradict each other.
    """
    left, turned = _joined(rests.rotation_covariance, turn, turn_covariance)
    in_body = rests.rotation.as_matrix().T
    board = offset_covariance + BOARD_M**2 * np.eye(3)
    rest_of, moved = _joined(in_body @ rests.position_covariance @ in_body.T, offset, board)
    # What each estimate says of the other's must be likely: 3 standard deviations, axis by axis.
    for what, value, covariance, factor, unit in (
        ("turned", turn, rests.rotation_covariance + turn_covariance, math.degrees(1.0), "deg"),
        ("beside", offset, in_body @ rests.position_covariance @ in_body.T + board, 1e3, "mm"),
    ):
        ratios = np.abs(value) / np.sqrt(np.diag(covariance))
        if ratios.max() > 3.5:
            axis = int(ratios.argmax())
            raise GeometryRefused(
                f"the flight shows the body {what} by {factor * value[axis]:+.1f} {unit} about its "
                f"{'xyz'[axis]} axis from where the rests had it, {ratios.max():.1f} standard uncertainties: "
                "were both rests on the same mark, nose along x in the first, the heights right? Do them anew"
            )
    rotation = rests.rotation * Rotation.from_rotvec(-left)
    matrix = rotation.as_matrix()
    return replace(
        rests,
        position=rests.position - matrix @ rest_of,
        rotation=rotation,
        position_covariance=matrix @ moved @ matrix.T,
        rotation_covariance=turned,
    )


def _joined(before: FloatArray, value: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best estimate of what `before` takes for zero and a measurement says is `value`, and its covariance."""
    gain = before @ np.linalg.inv(before + covariance)
    return gain @ value, (np.eye(3) - gain) @ before


def _heading_along_x(up: FloatArray, attitude: Rotation) -> Rotation:
    """Q with `up` (axes of the subject) as its third axis and the world's x in the plane of the other two."""
    ahead = attitude.inv().apply([1.0, 0.0, 0.0])
    ahead = ahead - up * float(up @ ahead)
    ahead = ahead / np.linalg.norm(ahead)
    return Rotation.from_matrix(np.column_stack([ahead, np.cross(up, ahead), up]))


def _position(
    first: Rest, second: Rest, normal: FloatArray, standing: Standing
) -> tuple[FloatArray, FloatArray]:
    """t by weighted least squares, and its covariance. Unknown are t and the place of the mark along x and y;
    the plate goes through the mark with that normal, so both origins are h above one point of it."""
    rows = np.zeros((6, 5))
    seen = np.zeros(6)
    for i, rest in enumerate((first, second)):
        # p + R t = (x, y, plate) + h n
        rows[3 * i : 3 * i + 3, :3] = rest.attitude.as_matrix()
        rows[3 * i : 3 * i + 2, 3:] = -np.eye(2)
        seen[3 * i : 3 * i + 3] = standing.height * normal - rest.position
        seen[3 * i + 2] += standing.plate
    placed = standing.placed_sigma
    scatter = [_of_mean(rest.place_scatter, rest) for rest in (first, second)]
    covariance = np.diag([v for s in scatter for v in (s**2 + placed**2, s**2 + placed**2, s**2)])
    # Height and plate are the same in both.
    common = standing.height_sigma**2 + standing.plate_sigma**2
    for i in (2, 5):
        for j in (2, 5):
            covariance[i, j] += common
    weights = np.linalg.inv(covariance + 1e-12 * np.eye(6))
    spread = np.linalg.inv(rows.T @ weights @ rows)
    solution = spread @ rows.T @ weights @ seen
    return np.asarray(solution[:3]), np.asarray(spread[:3, :3])


def _of_mean(scatter: float, rest: Rest) -> float:
    """Standard error of a mean of samples that are correlated over ten of them, at the least."""
    return scatter / math.sqrt(max(1.0, rest.samples / 10.0))


def rests_apart_deg(first: Rest, second: Rest) -> float:
    """Angle between two attitudes, deg."""
    return math.degrees(float((first.attitude.inv() * second.attitude).magnitude()))
