"""Tilted by hand: is the body that motion capture sees the body that the drone's own sensors are in?

Level and at rest, a subject that is turned about the vertical looks right. Tilted, nose down and then left
side down, it does not. The accelerometer of a drone that is held still shows where up is in the body; the
attitude of the poses must say the same. The estimator is no witness here: it hears the poses.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.health import PoseVerdict
from onboard.arrays import Vector
from onboard.lab_time import open_timebase
from onboard.timebase import Timebase
from perchhw.doctor.check_result import CheckResult, judged, not_known
from perchhw.doctor.mocap_checks import STILL, up_of
from perchhw.lab import correction_of

if TYPE_CHECKING:
    from onboard.link import DroneLink, LogSample
    from perchhw.lab.setup import FlightSetup

TOLERANCE_DEG = 8.0
"""deg between the two verticals: more than the doctor's 5 deg at rest, because no hand is quite still."""
WITHIN_S = 60.0
_LEAST, _SIDEWAYS = math.sin(math.radians(20.0)), math.sin(math.radians(12.0))
_HELD_SAMPLES, _PERIOD_MS, _LOOK_S = 30, 10, 0.05
_LOGGED: Final = ("acc.x", "acc.y", "acc.z")


@dataclass(frozen=True)
class _Tilt:
    """How the drone is to be held: the body axis that goes down, and the one that stays level (0 x, 1 y)."""

    name: str
    request: str
    down: int
    level: int


_TILTS = (
    _Tilt("nose_down", "Hold the drone still, nose down by 30 degrees", 0, 1),
    _Tilt("left_side_down", "Hold the drone still, left side down by 30 degrees", 1, 0),
)


def tilt(setup: "FlightSetup", tell: Callable[[str], None]) -> tuple[CheckResult, ...]:
    """Have the drone tilted by hand, and compare; the motors stay off.

    Args:
        setup: drone and motion capture.
        tell: says to the operator what to do; nothing is answered, the drone feels when it is done.

    Raises:
        LinkError: no link.
    """
    from onboard.link import DroneLink

    samples: deque[LogSample] = deque(maxlen=_HELD_SAMPLES)
    with open_timebase("bringup tilt", setup.drone, setup.mocap) as time:
        bridge = PoseBridge(setup.mocap, sink=None, clock=time, correction=correction_of(setup.lab))
        bridge.start()
        try:
            with (
                DroneLink.open(setup.drone, clock=time) as link,
                link.stream(_LOGGED, _PERIOD_MS, samples.append),
            ):
                return tuple(_compare(one, link, bridge, samples, time, tell) for one in _TILTS)
        finally:
            bridge.stop()


def _compare(
    wanted: _Tilt,
    link: "DroneLink",
    bridge: PoseBridge,
    samples: "deque[LogSample]",
    time: Timebase,
    tell: Callable[[str], None],
) -> CheckResult:
    why = "a subject that is turned about the vertical sends every correction the wrong way"
    remedy = "turn the subject in the motion capture so that x is forward and y left, or give subject_to_body"
    limit = f"at most {TOLERANCE_DEG:g} deg apart"
    tell(wanted.request)
    deadline = time() + WITHIN_S
    while time() < deadline and link.lost is None:
        time.event().wait(_LOOK_S)
        felt = _held(list(samples), wanted)
        status = bridge.status()
        attitude = None if status.last_good is None else status.last_good.quaternion
        if felt is None or attitude is None or status.verdict is not PoseVerdict.OK:
            continue
        seen = up_of(attitude)
        angle = math.degrees(_angle(felt, seen))
        measured = f"{angle:.1f} deg apart (drone {_words(felt)}, poses {_words(seen)})"
        return judged(wanted.name, angle <= TOLERANCE_DEG, measured, limit, why, remedy)
    return not_known(
        wanted.name,
        f"not seen within {WITHIN_S:g} s",
        limit,
        why,
        f"{wanted.request.lower()} for half a second, in sight of the cameras; is the board's front where "
        "you think it is?",
    )


def _held(samples: "list[LogSample]", wanted: _Tilt) -> Vector | None:
    """Where up is in the body, when all of the samples show a drone that is held as wanted."""
    if len(samples) < _HELD_SAMPLES:
        return None
    ups = []
    for sample in samples:
        x, y, z = (sample.values[name] for name in _LOGGED)
        size = math.hypot(x, y, z)
        if not STILL[0] <= size <= STILL[1]:
            return None
        up = (x / size, y / size, z / size)
        if up[wanted.down] > -_LEAST or abs(up[wanted.level]) > _SIDEWAYS:
            return None
        ups.append(up)
    x, y, z = (sum(parts) / len(ups) for parts in zip(*ups, strict=True))
    return x, y, z


def _angle(a: Vector, b: Vector) -> float:
    inner = sum(p * q for p, q in zip(a, b, strict=True))
    return math.acos(min(1.0, max(-1.0, inner / (math.hypot(*a) * math.hypot(*b)))))


def _words(up: Vector) -> str:
    return f"up = {up[0]:+.2f} {up[1]:+.2f} {up[2]:+.2f}"
