"""A motor stand on the simulated drone, and who else looks at its motors."""

import threading

from calibration.bench.instruments.errors import InstrumentLost
from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE, MotorStand
from onboard.clock import monotonic
from onboard.link import DroneLink
from tests.patience import PATIENCE_S


class Witness:
    """A second look at the motors, by a log block of its own: what the drone drives."""

    def __init__(self, link: DroneLink) -> None:
        self._changed = threading.Condition()
        self.ratios = (0, 0, 0, 0)
        self.seen: set[tuple[int, ...]] = set()
        self._stream = link.stream([f"motor.m{i}" for i in (1, 2, 3, 4)], 10, self._take)

    def _take(self, sample: object) -> None:
        with self._changed:
            self.ratios = tuple(int(value) for value in sample.values.values())  # type: ignore[attr-defined]
            self.seen.add(self.ratios)
            self._changed.notify_all()

    def await_ratios(self, ratios: tuple[int, int, int, int]) -> None:
        """Wait for these ratios."""
        with self._changed:
            assert self._changed.wait_for(lambda: self.ratios == ratios, PATIENCE_S), self.ratios

    def close(self) -> None:
        self._stream.close()


STILL = (0, 0, 0, 0)


class Power:
    """A remote cut that notes what it is told; `gone` makes it one that nobody holds any more."""

    def __init__(self) -> None:
        self.cuts: list[float] = []
        self.beats: list[float] = []
        self.resting = False
        self.gone = threading.Event()

    def cut(self) -> None:
        self.cuts.append(monotonic())

    def beat(self, within_s: float) -> None:
        if self.gone.is_set():
            raise InstrumentLost("the keeper is gone")
        self.beats.append(monotonic())

    def rest(self) -> None:
        self.resting = True


def unlocked(drone: DroneLink, **settings: object) -> MotorStand:
    stand = MotorStand(drone, **{"no_remote_cut": "remote_cut" not in settings, **settings})  # type: ignore[arg-type]
    stand.unlock(UNLOCK_PHRASE)
    return stand


def motors(stand: MotorStand, ratios: tuple[int, ...], witness: Witness | None = None) -> None:
    """Renew until the stand's own log shows these ratios, and the witness has seen them."""
    deadline, shown = monotonic() + PATIENCE_S, False
    while monotonic() < deadline:
        batch = stand.take(0.05)
        if batch.times.size:
            shown = tuple(batch.values[f"motor.m{i}"][-1] for i in (1, 2, 3, 4)) == ratios
        if shown and (witness is None or ratios in witness.seen):
            return
    raise AssertionError(f"the motors do not show {ratios}")


def renew_for_ever(stand: MotorStand) -> None:
    while True:
        stand.renew()
