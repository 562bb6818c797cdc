"""What the supervisor is told (events) and what it asks for (commands, given as numbered orders)."""

from dataclasses import dataclass

from onboard.arrays import Vector
from perchhw.supervisor.observation import Observation

# --- commands ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class UploadPolicy:
    """Write the policy bundle to the drone, read it back, make it live; the result is the live CRC."""


@dataclass(frozen=True, slots=True)
class Arm:
    """Ask the drone to arm its motors."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Climb vertically to `height` (m) within `duration` (s)."""

    height: float
    duration: float


@dataclass(frozen=True, slots=True)
class GoTo:
    """Fly to `position` (m, world frame), heading along +x, within `duration` (s)."""

    position: Vector
    duration: float


@dataclass(frozen=True, slots=True)
class ArmApproach:
    """Give the drone the approach trajectory, arm it, and arm the policy (two separate switches)."""


@dataclass(frozen=True, slots=True)
class StartApproach:
    """Start the armed approach."""


@dataclass(frozen=True, slots=True)
class FlyCourse:
    """Stream the setpoints of the test flight; done when its last one was reached, which then stays."""


@dataclass(frozen=True, slots=True)
class Brake:
    """Leave the approach on the drone: brake, then hold below the ceiling. The policy is switched off."""


@dataclass(frozen=True, slots=True)
class DisarmPolicy:
    """Switch the policy off on a drone that brakes by itself. The approach's switch hands it over: `Land`."""


@dataclass(frozen=True, slots=True)
class Land:
    """Descend to the floor where the drone is, within `duration` (s)."""

    duration: float


@dataclass(frozen=True, slots=True)
class Disarm:
    """Stop the motors and disarm."""


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Cut the motors now; the drone stays locked until it is rebooted."""


Command = (
    UploadPolicy
    | Arm
    | TakeOff
    | GoTo
    | ArmApproach
    | StartApproach
    | FlyCourse
    | Brake
    | DisarmPolicy
    | Land
    | Disarm
    | EmergencyStop
)
URGENT_COMMANDS = (Brake, DisarmPolicy, Land, Disarm)
"""Commands that do not wait behind others. An emergency stop has a path of its own, beside all of them."""


@dataclass(frozen=True, slots=True)
class Order:
    """A command that was given. Numbers grow from 1 by one within an attempt: answers name them.

    An order is in force until the phase that gave it is left (``FlightState.oldest_in_force``).
    """

    number: int
    command: Command


# --- events -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Tick:
    """A look at the world, some tens of times a second."""

    observation: Observation


@dataclass(frozen=True, slots=True)
class CommandDone:
    """`order` was carried out; `value` is what came back (the CRC of an uploaded policy)."""

    order: Order
    value: int | None = None


@dataclass(frozen=True, slots=True)
class CommandFailed:
    """`order` could not be carried out, and why."""

    order: Order
    reason: str


@dataclass(frozen=True, slots=True)
class StopConfirmed:
    """The drone reports that it is locked: its motors do not turn until it is rebooted."""


@dataclass(frozen=True, slots=True)
class StopUnconfirmed:
    """The emergency stop was repeated until the drone had said nothing for long, and why that is all."""

    reason: str


@dataclass(frozen=True, slots=True)
class LinkDown:
    """The link to the drone is gone for good, and why."""

    reason: str


@dataclass(frozen=True, slots=True)
class RecordLost:
    """The recorder failed; what happens from here on may not be on record."""

    reason: str


@dataclass(frozen=True, slots=True)
class InternalError:
    """The flight program itself failed in its loop, and how; nothing is known of the world this time."""

    reason: str


@dataclass(frozen=True, slots=True)
class HostStoodStill:
    """The flight program did nothing for a while, suspended or kept waiting by a busy computer; `reason`: for
    how long, and how long it may."""

    reason: str


@dataclass(frozen=True, slots=True)
class OperatorAbort:
    """The operator wants the flight to end now (Ctrl-C); `urgent` when asked a second time."""

    urgent: bool = False


Event = (
    Tick
    | CommandDone
    | CommandFailed
    | StopConfirmed
    | StopUnconfirmed
    | LinkDown
    | RecordLost
    | InternalError
    | HostStoodStill
    | OperatorAbort
)
