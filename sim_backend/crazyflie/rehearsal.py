"""Rehearsals on the desk, by the reference: ``core/rehearsal.c``."""

from onboard.app_interface import Rehearsal
from onboard.arrays import Vector
from onboard.flight_model import RATE, THRUST, flight_model, fly_model, hovering
from onboard.follower import CONTROL_PERIOD_MS
from onboard.mixer import Thrusts
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.engine import Sample
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.setpoint import complete_setpoint

STEP_S = 0.001
ORIGIN: Vector = (0.0, 0.0, 0.0)


class RehearsalMode:
    """Of one drone: which rehearsal is on, and the model that flies in one on it.

    Attributes:
        begins: whether one on the model begins with this step.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.begins = False
        self._asked = self._taken = Rehearsal.OFF
        self._model = flight_model(vehicle)
        self.start(ORIGIN)
        self._believed = Estimator()

    @property
    def is_on(self) -> bool:
        """Whether one is on, or begins with the next step."""
        return self._asked is not Rehearsal.OFF

    @property
    def is_on_model(self) -> bool:
        """Whether the step under way is one of a rehearsal on the model."""
        return self._taken is Rehearsal.MODEL

    @property
    def model(self) -> tuple[Vector, Vector]:
        """Position (m) and velocity (m/s) of the model."""
        x, y, z, vx, vy, vz = self._state[:6].tolist()
        return (x, y, z), (vx, vy, vz)

    def ask(self, wanted: int, at_rest: bool, is_idle: bool) -> Rehearsal:
        """Begin or end one, with the landing machine idle or not; which is on now."""
        goes_on = self.is_on and wanted == self._asked
        may = at_rest and wanted in frozenset(Rehearsal) and (goes_on or is_idle)
        self._asked = Rehearsal(wanted) if may else Rehearsal.OFF
        return self._asked

    def watch(self, sample: Sample) -> bool:
        """To be called first in each step; whether a rehearsal has ended with it.

        It ends where somebody flies or a motor has a thrust.
        """
        was = self._taken
        begun = was is not Rehearsal.OFF or self.is_on
        if sample.flying or sample.thrust_seen:
            self._asked = Rehearsal.OFF
        self._taken = self._asked
        self.begins = self._taken is Rehearsal.MODEL and was is not Rehearsal.MODEL
        return begun and not self.is_on

    def start(self, position: Vector) -> None:
        """The model hovers at `position` (m)."""
        self._state, self._place = hovering(position, self._model), position
        m1, m2, m3, m4 = self._state[THRUST:].tolist()
        self._thrusts: Thrusts = (m1, m2, m3, m4)

    def as_in_flight(self, sample: Sample) -> Sample:
        """What a drone has that flies and stays where it believes to be, or where its model shall be."""
        place = sample.estimator.position()
        if self.is_on_model:
            self._believed.state[:RATE] = self._state[:RATE]
            gyro = self._state[RATE : RATE + 3].copy()
            sample = sample._replace(estimator=self._believed, gyro=gyro, pose_age=0)
            place = self._place
        here = complete_setpoint(place)
        return sample._replace(flying=True, levelling=False, setpoint=here, set_at=sample.tick)

    def move(self, tick: int, thrusts: Thrusts, goal: Vector | None) -> None:
        """The model flies for a ms, by the `thrusts` (N) of the law's last step.

        `goal`: where the landing machine wants it (m); where the last one was it stays.
        """
        if self.is_on_model:
            self._place = goal or self._place
            if tick % CONTROL_PERIOD_MS == 0:  # in between they have been taken back
                self._thrusts = thrusts
            fly_model(self._state, self._thrusts, self._model, STEP_S)
