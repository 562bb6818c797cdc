"""What a sweep or a validation runs on: vehicle, legs, room and rules, as named in its settings."""

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from onboard.checked_arguments import checked_count, checked_name
from onboard.controller import AUTHORS_GAINS, ControllerGains, controller_gains
from onboard.quantity import Quantity
from onboard.room import RoomGeometry, ceiling_height
from onboard.vehicle import Vehicle, VehicleFileError, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from onboard.vehicle.fingerprint import fingerprint
from perchhw.attempt import AUTHORS_VEHICLE, STORED_VEHICLE
from perchhw.learning.authors_models import authors_vehicle
from perchhw.learning.domain_randomisation import VEHICLE, DomainRandomisation, domain_randomisation
from perchhw.learning.ephe import EpheSettings
from perchhw.learning.errors import LearningInputError
from perchhw.learning.reward import reward_weights
from perchhw.learning.trial import Rules
from perchhw.learning.vehicle_pool import acting, all_draws, parse_draws, vehicle_pool
from perchhw.trained_for import TrainedFor, trained_for
from sim_backend.physics.launch import Launch
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.rollout import RolloutSettings

MEASURED = "measured"
"""Preset of what real flights show."""

AUTHORS_LAUNCH = RolloutSettings(start_thrust=1.06, start_thrust_spread=0.05, unseen=0.01)
"""How the authors' simulation begins an approach. Its motors have been on for some 0.3 s and still overshoot
when the vehicle is set below the ceiling at its velocity; and the controller, whose poses come at 100 Hz,
takes it for standing still until the next one (SIM@52ee88af: CrazyflieEnv_ParamOpt.py, ParamOptim_reset;
CrazyflieEnv_Sim.py, Vel_Launch; crazyflie_BaseModel/model.sdf, Vicon_plugin). The thrust is set by v_z at the
trigger in their four tables, its spread by the scatter of v_z within a trial, 0.038 m/s (median of the shared
training set); no landing rate was used."""

SENSING: dict[str, RolloutSettings] = {
    "perfect": RolloutSettings(),
    "realistic": RolloutSettings(
        cue_delay_max=0.015, velocity_bias=0.02, velocity_noise=0.01, height_noise=0.001
    ),
    "late": RolloutSettings(
        cue_delay_min=0.015, cue_delay_max=0.015, velocity_bias=0.02, velocity_noise=0.02, height_noise=0.001
    ),
    "gazebo": RolloutSettings(cue_delay_min=0.002, cue_delay_max=0.004, velocity_bias=0.035),
    "gazebo-later": RolloutSettings(cue_delay_min=0.002, cue_delay_max=0.014, velocity_bias=0.035),
    "gazebo-launch": AUTHORS_LAUNCH._replace(cue_delay_min=0.002, cue_delay_max=0.004),
    "gazebo-launch-later": AUTHORS_LAUNCH._replace(cue_delay_min=0.002, cue_delay_max=0.014),
    MEASURED: RolloutSettings(
        cue_delay_max=0.015,
        velocity_bias=0.056,
        velocity_noise=0.01,
        height_noise=0.001,
        launch=Launch(
            reached_x=0.878,
            reached_z=1.040,
            spread_x=0.122,
            spread_y=0.187,
            spread_z=0.074,
            ceiling=0.029,
            ceiling_spread=0.034,
            flip_spread=0.019,
            flip_roll=0.034,
        ),
    ),
}
"""Errors of the cues. ``perfect`` is the paper's. ``realistic`` is what a mocap pose over radio and an
onboard estimator leave (engineering estimates): 0 to 15 ms of age, 0.02 m/s of lasting and 0.01 m/s of quick
error in velocity, 1 mm in height. ``late`` is a stress test with 15 ms of age always. ``gazebo`` stands for
the authors' simulation: cues pass between its processes in 2 to 4 ms (engineering estimate), and its launch
scatters v_z by 0.038 m/s within a trial (median of the shared training set), of which masses make 0.012.
In ``gazebo-later``, their sweeps from 2022-07-23 on, the policy looks at the 100 Hz samples at 100 Hz of its
own clock instead of at 500 Hz, so that a sample waits for up to 10 ms more (SIM@c8ab8eb4: controller_gtc.c).
``gazebo-launch`` and ``gazebo-launch-later`` are these two with :data:`AUTHORS_LAUNCH` in place of the error
of the cues that stands for it.
``measured`` is what 29 flights of the authors show (`perchhw gap landings`: launch, dispersion): speed that
is reached, ceiling, flip and velocity of the cues; their age and quick errors are those of ``realistic``. Its
ceiling is two days of one room, 62 to 68 and 12 mm higher than reckoned; another lab has another."""

GAZEBO_GAINS = AUTHORS_GAINS._replace(mass=34.3e-3)
"""Of the authors' randomised sweep. Its controller asks for the parameter CF_MASS, the file says CF_Mass: the
default of 34.3 g stays (SIM@6a3be0be: crazyflie_control/include/stabilizer.h, Model_Settings.yaml)."""

_POOL_KEY = 3
"""Of the random numbers of the pool of vehicles; the keys of trials have four parts."""


@dataclass(frozen=True)
class LearningSetup:
    """Settings that decide the result of rollouts, all of them values that JSON can hold.

    Attributes:
        vehicle: name or path. legs: name of a design, None for the vehicle's own.
        leg_angle_deg, leg_length_m: replace those of the design.
        reward, domain, sensing, gains: names of presets.
        randomise: quantities of the vehicle file that are drawn too, ``NAME`` or ``NAME=SIGMA``
            (:mod:`vehicle_pool`); a name replaces what the preset says of it.
        ceiling_z: m, above the floor.
        seed: of everything random.
        launch: values of :class:`sim_backend.physics.launch.Launch` in place of those of `sensing`.
    """

    vehicle: str = "crazyflie21-upgraded"
    legs: str | None = None
    leg_angle_deg: float | None = None
    leg_length_m: float | None = None
    reward: str = "paper"
    domain: str = "paper"
    randomise: tuple[str, ...] = ()
    sensing: str = "realistic"
    gains: str = "default"
    ceiling_z: float = RoomGeometry().ceiling_z
    seed: int = 0
    launch: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what no rollout can have, and make numbers of numpy plain ones, which JSON can hold.

        Raises:
            CeilingError: there is no such ceiling.
            ArgumentError: the seed is none, or the vehicle neither name nor path.
        """
        object.__setattr__(self, "vehicle", checked_name(self.vehicle, "vehicle"))
        object.__setattr__(self, "ceiling_z", ceiling_height(self.ceiling_z))
        object.__setattr__(self, "seed", checked_count(self.seed, "seed"))

    def load_vehicle(self) -> Vehicle:
        """The vehicle with the legs that are asked for.

        Raises:
            VehicleFileError: vehicle or leg design cannot be used.
            LearningInputError: it has no legs, or the leg's numbers are impossible.
        """
        if self.vehicle == AUTHORS_VEHICLE and self.legs is not None:
            vehicle = authors_vehicle(STORED_VEHICLE, self.legs)  # their legs differ in mass, too
        else:
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

    def recipe(self) -> "Recipe":
        """The setup with its vehicle in full.

        Raises:
            VehicleFileError, LearningInputError: see :meth:`load_vehicle`.
        """
        return Recipe(self, vehicle_to_toml(self.load_vehicle()))

    def load(self) -> tuple[Any, Rules]:
        """Physics parameters of the nominal vehicle, and the rules of all rollouts.

        Raises:
            VehicleFileError, LearningInputError, SimulationError: see :meth:`load_vehicle` and
                :meth:`Recipe.build`.
        """
        return self.recipe().build()

    def describe(self) -> dict[str, Any]:
        """The settings, with a fingerprint of the vehicle, for records and for comparing runs."""
        settings = {**dataclasses.asdict(self), "randomise": sorted(self.randomise)}
        if not self.launch:
            del settings["launch"]
        return {**settings, "vehicle_sha256": fingerprint(self.recipe().vehicle_toml)}


def recorded_setup(settings: Mapping[str, Any], where: str) -> LearningSetup:
    """The setup whose :meth:`LearningSetup.describe` a record holds.

    Args:
        settings: as recorded. where: names the record in errors.

    Raises:
        LearningInputError: the settings lack one, or the vehicle is no longer the same.
        VehicleFileError: its vehicle cannot be read any more.
    """
    names = [field.name for field in dataclasses.fields(LearningSetup) if field.name != "launch"]
    missing = [name for name in names if name not in settings]
    if missing:
        raise LearningInputError(f"{where}: the settings of the sweep lack {', '.join(missing)}")
    values = {name: settings[name] for name in names}
    launch = tuple(settings.get("launch", ()))
    setup = LearningSetup(**{**values, "randomise": tuple(values["randomise"]), "launch": launch})
    if setup.describe().get("vehicle_sha256") != settings.get("vehicle_sha256"):
        raise LearningInputError(
            f"{where}: vehicle {setup.vehicle!r} has changed since the sweep: sweep again"
        )
    return setup


def trained_on(settings: Mapping[str, Any]) -> TrainedFor | None:
    """What a policy is trained for that learns from a sweep with these settings.

    None where the sweep's vehicle is not there any more as it was: such a policy does not say it.
    """
    try:
        setup = recorded_setup(settings, "sweep")
        domain = domain_randomisation(setup.domain)
    except (LearningInputError, VehicleFileError):
        return None
    return trained_for(setup.load_vehicle(), mass=domain.mass, inertia_yy=domain.inertia_yy)


@dataclass(frozen=True)
class Recipe:
    """All that rollouts need, as plain text and numbers: it can be sent to a machine without our files."""

    setup: LearningSetup
    vehicle_toml: str

    def build(self) -> tuple[Any, Rules]:
        """Physics parameters of the nominal vehicle, and the rules of all rollouts.

        Raises:
            LearningInputError: a preset that is not known, or a quantity that cannot be drawn.
            SimulationError: the vehicle has an effect that the physics lacks.
        """
        setup = self.setup
        if setup.sensing not in SENSING:
            raise LearningInputError(
                f"sensing {setup.sensing!r} is not known: choose one of {', '.join(SENSING)}"
            )
        rollout = SENSING[setup.sensing]
        if setup.launch:
            rollout = rollout._replace(launch=Launch(*setup.launch))
        content = tomllib.loads(self.vehicle_toml)
        vehicle = parse_vehicle(content, setup.vehicle)
        room = RoomGeometry(ceiling_z=setup.ceiling_z)
        rules = Rules(
            gains=_gains(setup.gains, vehicle),
            domain=_domain(setup, content, room),
            rollout=rollout,
            reward=reward_weights(setup.reward),
            ephe=EpheSettings(),
        )
        return physics_parameters(vehicle, room), rules


@lru_cache(maxsize=4)
def prepared(recipe: Recipe) -> tuple[Any, Rules]:
    """:meth:`Recipe.build`, once in a process. Not to be changed by its users."""
    return recipe.build()


def _gains(name: str, vehicle: Vehicle) -> ControllerGains:
    if name == "default":
        return controller_gains(vehicle)
    if name == "authors":
        return AUTHORS_GAINS
    if name == "gazebo":
        return GAZEBO_GAINS
    raise LearningInputError(f"gains {name!r} are not known: choose default, authors or gazebo")


def _domain(setup: LearningSetup, content: dict[str, Any], room: RoomGeometry) -> DomainRandomisation:
    """The preset, with a pool for the quantities that are named."""
    domain = domain_randomisation(setup.domain)
    named = parse_draws(setup.randomise, content)
    draws = acting(named, content, room)
    if len(draws) < len(named):
        idle = next(draw.name for draw in named if draw not in draws)
        raise LearningInputError(
            f"--randomise {idle}: it does not act in a landing attempt; cues have their errors by --sensing"
        )
    names = [draw.name for draw in draws]
    if setup.domain == VEHICLE:
        others = [draw for draw in all_draws(content) if draw.name not in names]
        draws += acting(others, content, room)
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(setup.seed, spawn_key=(_POOL_KEY,))))
    return DomainRandomisation(
        mass=0.0 if "body.mass" in names else domain.mass,
        inertia_yy=0.0 if "body.inertia_yy" in names else domain.inertia_yy,
        pool=vehicle_pool(rng, draws, content, room),
    )
