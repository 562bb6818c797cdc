"""What goes wrong in a simulated lab; how it is asked for is in :mod:`sim_backend.faults`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from sim_backend.fault_values import (
    CHANCE,
    NO_TIME,
    TIME,
    FaultWindow,
    fault,
    integer,
    motor_pair,
    number,
    vector,
    window,
)
from sim_backend.survey import CeilingTruth, MissedTouch, ceiling_truth, missed_touch

_MOTOR = integer(1, 2, 3, 4)


@dataclass(frozen=True, slots=True)
class DroneFaults:
    """What goes wrong with every drone of the lab, each with what the command line takes and what it means.

    A frozen drone's motors keep their command. No checksum shows a policy's changed weight. Motors count from
    1, 0 is none. Windows and times are world time, s; the survey is :mod:`sim_backend.survey`.
    """

    battery_voltage: float | None = fault(
        number(2.0, 4.35), "V: open-circuit voltage of every fresh pack", None
    )
    link_loss: float = fault(CHANCE, "P: probability that a packet is lost, each way", 0.0)
    freeze_drone_at: float = fault(TIME, "S: the firmware hangs and answers nothing any more", math.inf)
    drone_dies_at: float = fault(TIME, "S: the drone loses its power", math.inf)
    policy_weight: float = fault(
        number(0.0, 2.0), "F: one weight of each policy that goes live is F times what it was", 1.0
    )
    motors_swapped: tuple[int, int] | None = fault(
        motor_pair, "A,B: the connectors of motors A and B (1 to 4) are exchanged", None
    )
    propeller_reversed: int = fault(
        _MOTOR, "N: the propeller of motor N is of the other direction and lifts nothing", 0
    )
    motor_reversed: int = fault(_MOTOR, "N: motor N turns the wrong way, and its propeller lifts nothing", 0)
    hung_at: FaultWindow = fault(
        window(120.0),
        "S[:DURATION]: the drone hangs on a thread, free to turn, its propellers off",
        NO_TIME,
    )
    held_at: FaultWindow = fault(
        window(2.0),
        "S[:DURATION]: a person holds the drone, nose down, then left side down, by 30 deg",
        NO_TIME,
    )
    survey_at: FaultWindow = fault(
        window(4.0),
        "S[:DURATION]: a person turns the drone by half a turn, then touches the ceiling at four points "
        "with the subject 'wand', each for DURATION",
        NO_TIME,
    )
    survey_ceiling: CeilingTruth | None = fault(
        ceiling_truth, "H,X,Y: height and tilts along x and y (m, deg) of the ceiling that is touched", None
    )
    survey_missed: MissedTouch | None = fault(
        missed_touch,
        "N,MM: the person's marker is MM mm below the ceiling at corner N; a fifth point and, twice, all "
        "corners follow",
        None,
    )
    gyro_bias: tuple[float, float, float] = fault(
        vector, "X,Y,Z: bias of the gyro after its calibration, rad/s", (0.0, 0.0, 0.0)
    )


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of a lab: of its drones, and those to hand to the room and to the bench as text."""

    drone: DroneFaults = field(default_factory=DroneFaults)
    room: Mapping[str, str] = field(default_factory=dict)
    bench: Mapping[str, str] = field(default_factory=dict)
