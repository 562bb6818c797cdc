"""The phases of an attempt, one function each: what it watches, when it moves on, and its deadline.

An unknown or late answer is an abort, never a wait without end.
"""

from collections.abc import Callable

from perchhw.supervisor import approach, ending, hovering, on_ground
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.state import Context, FlightState, Phase, Step

PHASES: dict[Phase, Callable[[FlightState, Admitted, Context], Step]] = {
    Phase.CHECKING: on_ground.checking,
    Phase.UPLOADING: on_ground.uploading,
    Phase.READY: on_ground.ready,
    Phase.ARMING: on_ground.arming,
    Phase.TAKING_OFF: hovering.taking_off,
    Phase.MOVING_TO_START: hovering.moving_to_start,
    Phase.ARMING_APPROACH: hovering.arming_approach,
    Phase.TEST_FLIGHT: hovering.flying_course,
    Phase.APPROACHING: approach.approaching,
    Phase.FLIPPING: approach.flipping,
    Phase.SETTLING: approach.settling,
    Phase.BRAKING: ending.braking,
    Phase.LANDING: ending.landing,
    Phase.DISARMING: ending.disarming,
    Phase.STOPPING: ending.stopping,
}
