"""The dialogue with the landing app: is it ours, arm an approach, take the drone back.

The app answers late (:mod:`onboard.app_interface`): a write that is echoed has arrived and has not acted yet.
So each request here is followed by its answer, polled until a deadline, and each switch is read back.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from onboard.app_interface import INTERFACE_VERSION, EngineCode, LandingState, Parameter, TrajectoryStatus
from onboard.link.errors import CommandRefused, LinkTimeout, NoSuchVariable
from onboard.timebase import WALL, Timebase
from onboard.trajectory import ApproachPlan

if TYPE_CHECKING:
    from onboard.link.drone import DroneLink

ARM_TIMEOUT_S = 0.5
"""The control loop consumes a request within 20 ms; the rest is for the radio."""

RELEASE_TIMEOUT_S = 3.0
"""A brake from 3.5 m/s holds after 0.9 s at most, and the hold is handed over after 1.5 s at most."""

_POLL_S = 0.01

_IN_COMMAND = frozenset(
    {
        LandingState.TRAJECTORY_ARMED,
        LandingState.APPROACH,
        LandingState.FLIP,
        LandingState.BRAKE,
        LandingState.HOLD,
    }
)
"""States in which the app flies, or may begin to. In CUT and FAULT the motors are off."""

_REASONS: dict[int, str] = {
    TrajectoryStatus.FLYING: "one is being flown",
    TrajectoryStatus.REFUSED_TOO_FAR: "the drone is too far from the approach's start",
    TrajectoryStatus.REFUSED_NUMBERS: "its numbers describe no sound approach",
    TrajectoryStatus.REFUSED_NOT_FLYING: "the drone does not fly",
}

T = TypeVar("T")


def check_interface(read: Callable[[str], float]) -> None:
    """Refuse a firmware without our app, or with one that speaks another version.

    Args:
        read: reads a parameter by its complete name.

    Raises:
        NoSuchVariable: with what to do about it.
    """
    version = int(read(Parameter.VERSION))
    if version != INTERFACE_VERSION:
        raise NoSuchVariable(
            f"the drone's perching app has interface version {version}, needed is {INTERFACE_VERSION}; "
            "flash the matching firmware"
        )


def check_vehicle(link: "DroneLink", expected_crc: int, vehicle: str) -> None:
    """Refuse a drone whose firmware was built for another vehicle than the host believes in.

    Args:
        link: the open link.
        expected_crc: :func:`onboard.firmware.constants.vehicle_crc32` of the host's vehicle.
        vehicle: its name, for the message.

    Raises:
        CommandRefused: the constants differ. NoSuchVariable: another firmware. LinkTimeout, LinkLost.
    """
    other = other_vehicle(link, expected_crc, vehicle)
    if other is not None:
        raise CommandRefused(other)


def other_vehicle(link: "DroneLink", expected_crc: int, vehicle: str) -> str | None:
    """What is wrong when the firmware was built for another vehicle; arguments as :func:`check_vehicle`.

    Raises:
        NoSuchVariable: another firmware. LinkTimeout, LinkLost.
    """
    check_interface(link.param)
    flashed = int(link.param(Parameter.VEHICLE_CRC))
    if flashed == expected_crc:
        return None
    return (
        f"the drone's firmware was built for another vehicle: its constants have CRC {flashed:08x}, "
        f"those of {vehicle} have {expected_crc:08x}; flash the firmware built for {vehicle}, or name "
        "the vehicle that is flashed (--vehicle)"
    )


def engine_of(link: "DroneLink") -> str | None:
    """Which code computes on the drone: ``c`` or ``reference``; None where the firmware is not ours.

    Raises:
        LinkTimeout, LinkLost: the link failed.
    """
    try:
        number = int(link.param(Parameter.ENGINE))
    except NoSuchVariable:
        return None
    return EngineCode(number).name.lower() if number in frozenset(EngineCode) else None


def arm_approach(
    link: "DroneLink",
    plan: ApproachPlan,
    time: Timebase = WALL,
    within: float = ARM_TIMEOUT_S,
    before_switch: Callable[[], None] = lambda: None,
) -> None:
    """Hand an approach to the drone, arm it, and arm the policy: two separate switches.

    Args:
        link: the open link.
        plan: the approach.
        time: clock and pauses.
        within: deadline for the drone's answer, s.
        before_switch: called before each of the switches is set; raises when that is no longer wanted.

    Raises:
        CommandRefused: the drone refuses, for the reason in the message, or a switch does not read back on.
        LinkTimeout: no answer by the deadline. LinkLost: the link is gone.
    """
    link.set_params(
        {
            Parameter.CEILING_Z: float(plan.ceiling_z),
            Parameter.IMPACT_X: float(plan.impact_x),
            Parameter.IMPACT_Y: float(plan.y0),
            Parameter.SPEED_X: float(plan.vx),
            Parameter.SPEED_Z: float(plan.vz),
            Parameter.ACCELERATION_X: float(plan.ax),
            Parameter.ACCELERATION_Z: float(plan.az),
            Parameter.TAU_START: float(plan.tau0),
        }
    )
    before_switch()
    link.set_param(Parameter.TRAJECTORY_ARM, 1)
    status = poll(
        lambda: int(link.param(Parameter.TRAJECTORY_STATUS)),
        lambda value: value != TrajectoryStatus.NONE,
        time,
        within,
    )
    if status == TrajectoryStatus.NONE:
        raise LinkTimeout(f"the drone did not say within {within:g} s whether it takes the approach")
    if status != TrajectoryStatus.ARMED:
        reason = _REASONS.get(status, f"status {status}, unknown to this program")
        raise CommandRefused(f"the drone refuses the approach: {reason}")
    before_switch()
    link.set_param(Parameter.POLICY_ARM, 1)
    _expect_switches(link, on=True)


def disarm_policy(link: "DroneLink") -> None:
    """Switch the policy off, and read that back. The approach keeps its switch: that hands the drone over.

    Raises:
        CommandRefused: it does not read back off. LinkTimeout, LinkLost: the link failed.
    """
    link.set_param(Parameter.POLICY_ARM, 0)
    _expect_switch(link, Parameter.POLICY_ARM, "policy", on=False)


def release(
    link: "DroneLink", time: Timebase = WALL, within: float = RELEASE_TIMEOUT_S
) -> LandingState | None:
    """Clear both switches, and wait until the app has handed the drone over, or its motors are off.

    Only then is a command to the planner sure to start from where the drone is.

    Args:
        link: the open link.
        time: clock and pauses.
        within: deadline for the hand-over, s.

    Returns:
        The app's state: IDLE, or CUT or FAULT when the motors are off; None for one that is not known here.

    Raises:
        CommandRefused: the app still has the drone at the deadline, or a switch does not read back off.
        LinkTimeout, LinkLost: the link failed.
    """
    link.set_params({Parameter.POLICY_ARM: 0, Parameter.TRAJECTORY_ARM: 0})
    state = poll(lambda: _state(link), lambda value: value not in _IN_COMMAND, time, within)
    if state is not None and state in _IN_COMMAND:
        raise CommandRefused(
            f"the landing app did not hand the drone over within {within:g} s, its state is {state.name}"
        )
    _expect_switches(link, on=False)
    return state


def _state(link: "DroneLink") -> LandingState | None:
    number = int(link.param(Parameter.STATE))
    return LandingState(number) if number in frozenset(LandingState) else None


def _expect_switches(link: "DroneLink", on: bool) -> None:
    """Raise unless both switches read as wanted: the app takes back what it does not grant."""
    for name, what in ((Parameter.TRAJECTORY_ARM, "approach"), (Parameter.POLICY_ARM, "policy")):
        _expect_switch(link, name, what, on)


def _expect_switch(link: "DroneLink", name: Parameter, what: str, on: bool) -> None:
    if bool(link.param(name)) is not on:
        wanted, found = ("on", "off") if on else ("off", "on")
        raise CommandRefused(f"the drone does not switch the {what} {wanted}: {name} reads {found}")


def poll(ask: Callable[[], T], done: Callable[[T], bool], time: Timebase, within: float) -> T:
    """Ask until the answer is final or `within` s are over; the last answer. The one place that waits."""
    deadline = time() + within
    pause = time.event()
    while not done(answer := ask()) and time() < deadline:
        pause.wait(_POLL_S)
    return answer
