"""Rehearsals in simulated time, without sockets."""

from dataclasses import dataclass, field

from onboard.app_interface import LandingState, Parameter, PolicyStatus, Rehearsal, TrajectoryStatus
from onboard.landing.model import landing_limits
from onboard.policy.bundle import encode_bundle
from onboard.policy.files import load_policy, shipped_policy_path
from onboard.ring import Ring, decode_ring
from onboard.room import RoomGeometry
from onboard.trajectory import fit_approach
from onboard.vehicle import load_vehicle
from perchhw.rehearsal.poses import LEVEL, ideal_state
from sim_backend.lab_faults import DroneFaults
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight

PLAN = fit_approach(2.5, 50.0, RoomGeometry())
POLICY = load_policy(shipped_policy_path("default"))
TRUE = load_vehicle(VEHICLE, LEGS)
SMOOTHING = landing_limits(TRUE).smoothing


@dataclass
class Desk:
    """A drone on a desk, and a host that sends it the poses of an approach, or lets it fly its own model.

    Attributes:
        kind: which of these.
        most_thrust: N, the largest that any motor had in truth.
    """

    faults: DroneFaults | None = None
    kind: Rehearsal = Rehearsal.POSES
    flight: Flight = field(init=False)
    most_thrust: float = 0.0

    def __post_init__(self) -> None:
        self.flight = Flight(seed=1, faults=self.faults)
        self.flight.poses = False
        self.flight.run(1.0)

    def begin(self) -> bool:
        """Ask for the mode; whether it is on."""
        self.flight.write(Parameter.REHEARSE, self.kind)
        return self.flight.param(Parameter.REHEARSE) == self.kind

    def send(self, seconds: float, moving: bool = False) -> None:
        """Poses at 100 Hz: of the approach's start, or on its way from the first one on. None for a model."""
        for ms in range(round(1000 * seconds)):
            if ms % 10 == 0 and self.kind is Rehearsal.POSES:
                position, _ = ideal_state(PLAN, SMOOTHING, 1e-3 * ms if moving else 0.0)
                height = min(position[2], PLAN.ceiling_z - 0.02)
                self.flight.firmware.localization.external_pose(position[0], position[1], height, *LEVEL)
            self.flight.tick()
            self.most_thrust = max(self.most_thrust, float(self.flight.drone.state["thrust"].max()))

    def arm(self) -> None:
        """Policy and approach, on a drone that believes to hover at the approach's start."""
        flight = self.flight
        assert flight.upload(encode_bundle(POLICY)) == PolicyStatus.ACTIVE
        assert self.begin()
        flight.write("kalman.resetEstimation", 1)
        self.send(2.0)
        flight.set_plan(PLAN)
        flight.write(Parameter.TRAJECTORY_ARM, 1)
        assert flight.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
        flight.write(Parameter.POLICY_ARM, 1)

    def state(self) -> LandingState:
        return LandingState(int(self.flight.log("perch.state")))

    def rehearse(self) -> Ring:
        """The whole approach, and what was recorded."""
        self.arm()
        self.flight.write(Parameter.GO, 1)
        self.send(PLAN.impact_time + 1.0, moving=True)
        return decode_ring(self.flight.firmware.engine.record())
