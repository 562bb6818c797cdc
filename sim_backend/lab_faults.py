"""What goes wrong in a simulated lab; how it is asked for is in :mod:`sim_backend.faults`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from sim_backend.fault_values import NO_TIME, FaultWindow
from sim_backend.survey import CeilingTruth


@dataclass(frozen=True, slots=True)
class DroneFaults:
    """What goes wrong with every drone of the lab.

    Attributes:
        battery_voltage: open-circuit voltage of each fresh pack, V (None: full).
        link_loss: probability that a packet is lost, each way.
        freeze_drone_at: the firmware stops and answers nothing any more; the motors keep their command.
        drone_dies_at: the drone loses its power at this time: motors off, radio silent.
        gyro_bias: bias that the gyro develops after its calibration, about x, y, z, rad/s.
        policy_weight: factor of one weight of each policy that goes live, which no checksum shows.
        motors_swapped: two motors (1..4) whose connectors are exchanged.
        propeller_reversed: motor (1..4) with the wrong kind of propeller, which lifts nothing; 0: none.
        motor_reversed: motor (1..4) that turns the wrong way, so that its propeller lifts nothing; 0: none.
        hung_at: while the drone hangs on a thread, free to turn, its propellers off.
        survey_at: a person surveys the room from then on (:mod:`sim_backend.survey`).
        survey_ceiling: the plane that is touched then; None: the room's.
        held_at: while a person holds the drone: half of the time nose down, then left side down, by 30 deg.
    """

    battery_voltage: float | None = None
    link_loss: float = 0.0
    freeze_drone_at: float = math.inf
    drone_dies_at: float = math.inf
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    policy_weight: float = 1.0
    motors_swapped: tuple[int, int] | None = None
    propeller_reversed: int = 0
    motor_reversed: int = 0
    hung_at: FaultWindow = NO_TIME
    held_at: FaultWindow = NO_TIME
    survey_at: FaultWindow = NO_TIME
    survey_ceiling: CeilingTruth | None = None


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of a lab: of its drones, and those to hand to the room and to the bench as text."""

    drone: DroneFaults = field(default_factory=DroneFaults)
    room: Mapping[str, str] = field(default_factory=dict)
    bench: Mapping[str, str] = field(default_factory=dict)
