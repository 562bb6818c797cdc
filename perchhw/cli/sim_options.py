"""Options of ``perchhw sim``: what its verbs share, and what a simulated drone is asked to be."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.engine_option import Engine
from perchhw.cli.options import Legs, Vehicle
from sim_backend.faults import fault_table, parse_faults

if TYPE_CHECKING:
    from sim_backend.lab import LabSettings

Drones = Annotated[int, typer.Option(min=1, max=32, help="Number of drones: cf1, cf2 ...")]
DronePort = Annotated[
    int, typer.Option(min=0, max=65535, help="UDP port of cf1, the others follow; 0: free ones.")
]
ViconPort = Annotated[int, typer.Option(min=0, max=65535, help="TCP port of the Vicon DataStream; 0: free.")]
ViconUdpPort = Annotated[
    int, typer.Option(min=0, max=65535, help="UDP port that the Vicon object stream is sent to; 0: free.")
]
Truth = Annotated[Path | None, typer.Option(help="Write the true state to this CSV file at 100 Hz.")]
TruthMotors = Annotated[
    bool, typer.Option("--truth-motors", help="With the largest motor command as the last column of --truth.")
]
LabFileOut = Annotated[
    Path | None,
    typer.Option(
        "--lab",
        help="Write the lab file of this room here while it is served; default: in a temporary folder.",
    ),
]
Fault = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Show a fault; may be repeated. " + " ".join(f"{n}={t}." for n, t in fault_table().items()),
    ),
]
Flashed = Annotated[
    str | None,
    typer.Option(help="Vehicle file that the drones' firmware was built with, if it is not what they are."),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")]
FeedPoses = Annotated[
    bool,
    typer.Option(
        "--feed-poses", help="Send the drones their true poses at 100 Hz, for clients that bring none."
    ),
]
BenchPace = Annotated[
    float, typer.Option(help="How many times as fast as real time the bench lives, up to 50.")
]
LabPace = Annotated[
    str,
    typer.Option(
        "--pace",
        metavar="real|lockstep|FACTOR",
        help="How the lab's time goes. real: as the clock, for clients of any kind. lockstep: as fast as "
        "those who fly in it, never faster; a busy machine changes nothing. FACTOR: so, at most so fast.",
    ),
]
AutoArm = Annotated[
    bool, typer.Option("--auto-arm", help="The drone arms by itself, as the stock build does.")
]
IdleThrust = Annotated[
    int,
    typer.Option(
        min=0, max=65535, help="Ratio at which motors that may turn idle; the stock build has 7000, ours 0."
    ),
]
Deck = Annotated[
    list[str] | None,
    typer.Option(help="Name of an attached deck, such as bcFlow2; nothing that it measures is simulated."),
]
Radio = Annotated[
    bool,
    typer.Option(
        "--radio", help="As over a Crazyradio: 350 packets a second each way, latency, the drone's queues."
    ),
]
WithParent = Annotated[
    bool, typer.Option("--with-parent", help="End when standard input ends, as it does when the parent dies.")
]


@dataclass(frozen=True)
class WorldOptions:
    """What every part of the simulated world is told."""

    vehicle: Vehicle = DEFAULT_VEHICLE
    legs: Legs = None
    fault: Fault = None
    seed: Seed = 0

    def world_settings(self) -> dict[str, Any]:
        """Fields of the settings of a lab or a bench.

        Raises:
            SimulationError: a fault that there is not.
        """
        return {
            "vehicle": self.vehicle,
            "legs": self.legs,
            "faults": parse_faults(self.fault or ()),
            "seed": self.seed,
        }


@dataclass(frozen=True)
class DroneOptions(WorldOptions):
    """The drones of a lab."""

    drone_port: DronePort = 19850
    drones: Drones = 1
    flashed: Flashed = None
    truth: Truth = None
    truth_motors: TruthMotors = False
    pace: LabPace = "real"
    engine: Engine = None
    feed_poses: FeedPoses = False
    radio: Radio = False
    auto_arm: AutoArm = False
    idle_thrust: IdleThrust = 0
    deck: Deck = None

    def settings(self, **room: Any) -> "LabSettings":
        """The lab with these drones; `room`: fields of its settings that are no drone's.

        Raises:
            SimulationError: a fault, a pace or a deck that there is not.
        """
        if self.truth_motors and self.truth is None:
            raise typer.BadParameter("--truth-motors goes with --truth")
        from sim_backend.crazyflie.build import Build, known_decks
        from sim_backend.lab import LabSettings
        from sim_backend.pace import Pace

        return LabSettings(
            flashed=self.flashed,
            drones=self.drones,
            drone_port=self.drone_port,
            truth=self.truth,
            truth_motors=self.truth_motors,
            pace=Pace.parse(self.pace),
            engine=self.engine,
            feed_poses=self.feed_poses,
            radio=self.radio,
            build=Build(self.auto_arm, self.idle_thrust, known_decks(self.deck or ())),
            **self.world_settings(),
            **room,
        )
