"""From the trigger to the end: the limits of a flip, whether what has landed holds, and motors that were cut
before a drone was down."""

from math import degrees, pi

from onboard.app_interface import EndReason, LandingState
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.state import FlightState, Phase
from perchhw.supervisor.violation import Violation, at_least

STOPPED_ELSEWHERE = "somebody else stopped the drone, or its own supervisor did"
"""Who cut the motors of a drone that was not stopped by us, and does not lie."""

_OF_THE_APP = (LandingState.FLIP, LandingState.CUT, LandingState.FAULT)


def inside_flip(o: Admitted, height: float | None, limits: SafetyLimits) -> Violation | None:
    """What mocap sees of a flip that began at `height` (m) is a flip under the ceiling, not a fall.

    Mocap may lose a body that turns at 30 rad/s: not to see it is no violation; the flip has a deadline.
    """
    if o.pose_position is None or height is None:
        return None
    x, y, z = o.pose_position
    room = limits.room
    if not (room.x_min <= x <= room.x_max and room.y_min <= y <= room.y_max):
        return Violation("flip_in_room", f"({x:.2f}, {y:.2f}) m", f"inside {room}")
    return at_least("flip_height", z - height, -limits.flip_drop, "m from that of the trigger")


def does_not_hold(o: Admitted, limits: SafetyLimits) -> str | None:
    """Why the drone is not known to hang from the ceiling by four feet, for the operator, or ``None``."""
    if o.pose_position is None or o.pose_attitude is None:
        return "NOT SEEN: mocap has no pose of the drone under the ceiling; it may fall"
    x, y, z = o.pose_position
    distance = limits.room.ceiling_at(x, y) - z
    if distance > limits.hang_distance:
        return f"FALLING OR FALLEN: the drone is {distance:.2f} m below the ceiling"
    tilt = pi - o.pose_attitude.tilt
    if tilt > limits.hang_tilt:
        return f"HALF ATTACHED: the drone hangs tilted by {degrees(tilt):.0f} deg; it may fall"
    return None


def fell_because(why: str) -> str:
    """What the operator is told of motors that were cut before the drone was down, because of `why`."""
    return f"MOTORS CUT BEFORE IT WAS DOWN: {why}; a drone in the air has fallen"


def cut_by_supervisor(state: FlightState, o: Admitted, limits: SafetyLimits) -> str | None:
    """What to tell when the drone's supervisor lets no motor turn in a phase of upright flight, or ``None``.

    What the landing app did itself is for :func:`cut_by_itself`; after a trigger nobody expects to fly.
    """
    drone = o.drone
    if drone is None or drone.can_fly or o.landing_state in _OF_THE_APP:
        return None
    if state.phase in (Phase.TAKING_OFF, Phase.LANDING) and is_down(o, limits):
        return None
    if drone.is_tumbled or drone.is_crashed:
        return fell_because("the drone's own supervisor did it, it lies or tumbles")
    return fell_because(STOPPED_ELSEWHERE)


def is_down(o: Admitted, limits: SafetyLimits) -> bool:
    """Whether the drone is known to be on the floor, by its own estimate."""
    position = o.estimate_position
    return position is not None and position[2] - limits.room.floor_z < limits.height_on_ground


def cut_by_itself(o: Admitted) -> str | None:
    """What to tell when the landing app has cut the motors without a landing, or ``None``."""
    match o.landing_state:
        case LandingState.FAULT:
            why = "its estimate cannot be true any more (FAULT)"
        case LandingState.CUT if o.end_reason is EndReason.NOT_FLYING:
            why = "its supervisor ended the flight (CUT)"
        case LandingState.CUT:
            why = "it met the ceiling, or was tilted by more than 70 deg (CUT)"
        case _:
            return None
    return fell_because(f"the drone did it by itself, {why}")
