"""What a sweep or a validation runs on: vehicle, legs, room and rules, as named in its settings."""

import dataclasses
import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from onboard.controller import AUTHORS_GAINS, ControllerGains, controller_gains
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle, vehicle_to_toml
from perchhw.learning.domain_randomisation import domain_randomisation
from perchhw.learning.ephe import EpheSettings
from perchhw.learning.errors import LearningInputError
from perchhw.learning.reward import reward_weights
from perchhw.learning.trial import Rules
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.rollout import RolloutSettings

SENSING: dict[str, RolloutSettings] = {
    "perfect": RolloutSettings(),
    "realistic": RolloutSettings(
        cue_delay_max=0.015, velocity_bias=0.02, velocity_noise=0.01, height_noise=0.001
    ),
    "late": RolloutSettings(
        cue_delay_min=0.015, cue_delay_max=0.015, velocity_bias=0.02, velocity_noise=0.02, height_noise=0.001
    ),
}
"""Errors of the cues. ``perfect`` is the paper's. ``realistic`` is what a mocap pose over radio and an
onboard estimator leave (engineering estimates): 0 to 15 ms of age, 0.02 m/s of lasting and 0.01 m/s of quick
error in velocity, 1 mm in height. ``late`` is a stress test with 15 ms of age always."""


@dataclass(frozen=True)
class LearningSetup:
    """Settings that decide the result of rollouts, all of them values that JSON can hold.

    Attributes:
        vehicle: name or path. legs: name of a design, None for the vehicle's own.
        leg_angle_deg, leg_length_m: replace those of the design.
        reward, domain, sensing, gains: names of presets.
        ceiling_z: m.
        seed: of everything random.
    """

    vehicle: str = "crazyflie21-upgraded"
    legs: str | None = None
    leg_angle_deg: float | None = None
    leg_length_m: float | None = None
    reward: str = "paper"
    domain: str = "paper"
    sensing: str = "perfect"
    gains: str = "default"
    ceiling_z: float = RoomGeometry().ceiling_z
    seed: int = 0

    def load_vehicle(self) -> Vehicle:
        """The vehicle with the legs that are asked for.

        Raises:
            VehicleFileError: vehicle or leg design cannot be used.
            LearningInputError: it has no legs, or the leg's numbers are impossible.
        """
        vehicle = load_vehicle(self.vehicle, self.legs)
        if vehicle.legs is None:
            raise LearningInputError(
                f"vehicle {self.vehicle!r} has no legs to land on: name a design (--legs)"
            )
        legs = vehicle.legs
        source = "command line"
        if self.leg_angle_deg is not None:
            if not 0.0 <= self.leg_angle_deg <= 90.0:
                raise LearningInputError(f"--leg-angle-deg {self.leg_angle_deg:g}: give 0 to 90 deg")
            legs = dataclasses.replace(
                legs, design="custom", angle_deg=Quantity(self.leg_angle_deg, "deg", 0.0, source)
            )
        if self.leg_length_m is not None:
            if not 0.01 <= self.leg_length_m <= 0.3:
                raise LearningInputError(f"--leg-length-m {self.leg_length_m:g}: give 0.01 to 0.3 m")
            legs = dataclasses.replace(
                legs, design="custom", length=Quantity(self.leg_length_m, "m", 0.0, source)
            )
        return dataclasses.replace(vehicle, legs=legs)

    def load(self) -> tuple[Any, Rules]:
        """Physics parameters and the rules of all rollouts.

        Raises:
            VehicleFileError, LearningInputError: see :meth:`load_vehicle`; a preset that is not known.
            SimulationError: the vehicle has an effect that the physics lacks.
        """
        if self.sensing not in SENSING:
            raise LearningInputError(
                f"sensing {self.sensing!r} is not known: choose one of {', '.join(SENSING)}"
            )
        vehicle = self.load_vehicle()
        rules = Rules(
            gains=self._gains(vehicle),
            domain=domain_randomisation(self.domain),
            rollout=SENSING[self.sensing],
            reward=reward_weights(self.reward),
            ephe=EpheSettings(),
        )
        return physics_parameters(vehicle, RoomGeometry(ceiling_z=self.ceiling_z)), rules

    def _gains(self, vehicle: Vehicle) -> ControllerGains:
        if self.gains == "default":
            return controller_gains(vehicle)
        if self.gains == "authors":
            return AUTHORS_GAINS
        raise LearningInputError(f"gains {self.gains!r} are not known: choose default or authors")

    def describe(self) -> dict[str, Any]:
        """The settings, with a fingerprint of the vehicle, for records and for comparing runs."""
        text = vehicle_to_toml(self.load_vehicle())
        return {**dataclasses.asdict(self), "vehicle_sha256": hashlib.sha256(text.encode()).hexdigest()}


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on."""
    return {package: version(package) for package in ("perchhw", "numpy", "numba")}
