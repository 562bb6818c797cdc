"""A landing attempt for :mod:`tests.flight.stepped_flight`: policy, approach and flip, by the firmware."""

from collections.abc import Mapping
from dataclasses import replace

from onboard.app_interface import EndReason, LandingState
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.room import RoomGeometry
from onboard.trajectory import fit_approach
from perchhw.flight.actions import LandingCommands
from perchhw.flight.mission import AttemptPlan
from perchhw.flight.readback import LANDING_SETTINGS, ReadBack
from perchhw.supervisor import Mission, Observation, Order
from tests.flight.stepped_flight import HOVER, DirectLink, Flown, SteppedQueue, SteppedTime
from tests.sim_crazyflie.simulated_flight import Flight
from tests.sim_crazyflie.small_policy import small_policy

BUNDLE = encode_bundle(small_policy())
APPROACH = fit_approach(2.5, 60.0, RoomGeometry())
MISSION = Mission(
    policy_crc=bundle_crc32(BUNDLE),
    start=(float(APPROACH.x0), float(APPROACH.y0), float(APPROACH.z0)),
    hover_height=HOVER,
    approach_duration=float(APPROACH.impact_time),
    corridor=APPROACH,
)


class LandingLink(DirectLink):
    """A link that also knows the landing app."""

    def __init__(self, flight: Flight, readback: ReadBack) -> None:
        super().__init__(flight)
        self._readback = readback

    def param(self, name: str) -> float:
        """As the link's."""
        return self._flight.param(name)

    def set_param(self, name: str, value: float) -> None:
        """As the link's."""
        self._flight.write(name, value)

    def set_params(self, values: Mapping[str, float]) -> None:
        """As the link's."""
        for name, value in values.items():
            self.set_param(name, value)

    def upload_policy(self, bundle: bytes) -> int:
        """As the link's."""
        self._flight.upload(bundle)
        return int(self._flight.log("perch.polCrc"))

    def observe(self) -> Observation:
        """What telemetry would say."""
        log = self._flight.log
        return replace(
            super().observe(),
            landing_state=LandingState(int(log("perch.state"))),
            landing_age=0.01,
            end_reason=EndReason(int(log("perch.reason"))),
            trigger_count=int(log("perchT.count")),
            active_policy_crc=int(log("perch.polCrc")),
            policy_crc_age=0.01,
            policy_armed=self._readback.policy_armed,
            trajectory_armed=self._readback.trajectory_armed,
            parameters_ok=self._readback.parameters_ok,
        )


class DirectLanding(LandingCommands):
    """Carries every order out at once."""

    def submit(self, order: Order) -> None:
        """Start and finish."""
        self._answer(order)


def landing_attempt(flight: Flight, time: SteppedTime, events: SteppedQueue) -> Flown:
    """An approach at 2.5 m/s and 60 deg, with a policy that triggers."""
    readback = ReadBack()
    link = LandingLink(flight, readback)
    readback.check_settings(link, LANDING_SETTINGS)  # type: ignore[arg-type]
    plan = AttemptPlan(approach=APPROACH, mission=MISSION)
    commands = DirectLanding(link, events, time, readback, plan, BUNDLE, None)  # type: ignore[arg-type]
    return Flown(link, commands, MISSION)
