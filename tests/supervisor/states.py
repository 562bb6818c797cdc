"""States and observations to begin a test with: any phase of an attempt, all well."""

from dataclasses import replace

from onboard.app_interface import LandingState
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor import FlightState, Mission, Observation, Phase

from .simulated_attempt import CRC, FLYING, INVERTED, MISSION, PLAN, TEST_FLIGHT, good_on_ground

BEFORE_ARMING = (Phase.CHECKING, Phase.UPLOADING, Phase.READY)
ON_GROUND = (*BEFORE_ARMING, Phase.ARMING)
HOVERING = (Phase.TAKING_OFF, Phase.MOVING_TO_START, Phase.ARMING_APPROACH, Phase.TEST_FLIGHT)
DESCENDING = (Phase.BRAKING, Phase.LANDING)
TO_ARM = 3.0
"""When a mission that waits for its time may arm, s."""
ALL_PHASES = tuple(phase for phase in Phase if phase is not Phase.DONE)


def mission_of(phase: Phase) -> Mission:
    """A mission that has the phase."""
    if phase is Phase.READY:
        return replace(MISSION, arm_at=TO_ARM)
    return TEST_FLIGHT if phase is Phase.TEST_FLIGHT else MISSION


def state_in(phase: Phase) -> FlightState:
    """A state that entered `phase` at 0 s; its order has the number 7."""
    before = phase in BEFORE_ARMING
    return FlightState(
        phase=phase,
        entered_at=0.0,
        orders_given=7,
        oldest_in_force=7,
        arm_ordered=not before,
        armed=not before and phase is not Phase.ARMING,
        airborne_since=None if phase in ON_GROUND else 0.0,
        triggered=phase in (Phase.FLIPPING, Phase.SETTLING),
        flip_height=PLAN.ceiling_z - 0.3 if phase is Phase.FLIPPING else None,
    )


def good_in(phase: Phase) -> Observation:
    """All is well in `phase`, and nothing moves it on."""
    ground = good_on_ground()
    if phase in ON_GROUND:
        return replace(ground, active_policy_crc=CRC)
    place = MISSION.start if phase is not Phase.MOVING_TO_START else (-1.0, 0.0, 1.0)
    flying = replace(
        ground,
        pose_position=place,
        estimate_position=place,
        drone=SupervisorInfo(FLYING),
        battery_voltage=3.4,
        active_policy_crc=CRC,
    )
    hanging = (PLAN.impact_x, PLAN.y0, PLAN.ceiling_z - 0.075)
    match phase:
        case Phase.APPROACHING:
            return replace(flying, landing_state=LandingState.APPROACH)
        case Phase.BRAKING:
            return replace(flying, landing_state=LandingState.BRAKE)
        case Phase.FLIPPING:
            return replace(flying, landing_state=LandingState.FLIP, pose_position=hanging)
        case Phase.SETTLING | Phase.DISARMING:
            return replace(
                flying, landing_state=LandingState.CUT, pose_position=hanging, pose_quaternion=INVERTED
            )
    return flying
