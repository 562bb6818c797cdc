"""Turns the motors of a clamped drone, and stops them on every way out.

The firmware's parameters ``motorPowerSet.*`` override everything, the supervisor and its emergency stop
included, and no watchdog of the stock firmware ends them: a host that dies leaves the motors running (our app
on the drone ends that: :mod:`calibration.bench.instruments.motor_token`). So the stand stops them itself: at
the end of its ``with`` block whatever the reason, when nobody renews within 0.4 s, when the drone is silent
for 0.35 s (both times :attr:`onboard.link.DroneLink.patience`), when an instrument is lost. When the link is
lost only the power is left: a supply is switched off, and the drone's processor is restarted through its
radio chip. And when the host itself dies or hangs, only somebody else can switch the supply off: without a
:class:`RemoteCut` nothing turns, unless the operator does without, or our app on the drone is demanded.

>>> with MotorStand(drone, remote_cut=kept_supply) as stand:        # doctest: +SKIP
...     stand.unlock("props guarded, drone clamped")
...     stand.spin({1: pwm(128)})
...     while measuring:
...         stand.renew()
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from calibration.bench.instruments.drone_log import DroneLog, LogBatch, refuse_armed
from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    MotorsNotStopped,
    MotorsRefused,
)
from calibration.bench.instruments.motor_token import MotorToken
from calibration.bench.instruments.set_points import check_set_point
from calibration.bench.instruments.supply_keeper import HANG_S
from onboard.clock import Clock, monotonic
from onboard.closing import Closing
from onboard.errors import PerchhwError
from onboard.link import DroneLink, LinkError, reboot

#: What the operator of a bench types to unlock the motors; a stand elsewhere asks for what is so there.
UNLOCK_PHRASE = "props guarded, drone clamped"
#: Renew at least so often. With the time of a stop the motors are off within 0.5 s [s].
RENEW_WITHIN_S = 0.4
_LOOK_S = 0.02
_STOP_TRIES = 3
#: A drone that sends 100 samples a second is out of reach when none comes for so long [s].
_SILENCE_S = 0.35
_REBOOT_S = 3.0
_ZERO_WITHIN_S = 0.3
_MOTORS = (1, 2, 3, 4)
_EACH, _ALL, _ALL_COMPENSATED = 1, 2, 3
_ENABLE = "motorPowerSet.enable"
_LOG_NAMES = ("pm.vbat", "motor.m1", "motor.m2", "motor.m3", "motor.m4")


@dataclass(frozen=True, slots=True)
class MotorStopReport:
    """How a stop went.

    Attributes:
        confirmed: the drone's override is read back as off, and its log shows motors at zero.
        seconds: from the request to the confirmation, or to giving up [s].
        reason: why it was stopped.
        trouble: what went wrong, in words; empty when confirmed.
    """

    confirmed: bool
    seconds: float
    reason: str
    trouble: str


class RemoteCut(Protocol):
    """A supply that somebody else switches off when this process dies (``KeptSupply``)."""

    def cut(self) -> None:
        """Switch it off now; InstrumentError when that is not known to have happened."""

    def beat(self, within_s: float) -> None:
        """We live; unless said again `within_s` it is switched off. InstrumentLost: nobody would do it."""

    def rest(self) -> None:
        """Our motors do not turn any more: no need to say that we live. InstrumentLost as :meth:`beat`."""


class MotorStand(Closing):
    """The motors of one drone on the bench; a context manager. Commands from one thread.

    Attributes:
        stopped: how the last stop went; None before the first.
    """

    def __init__(
        self,
        drone: DroneLink,
        *,
        instruments: Sequence[Callable[[], None]] = (),
        remote_cut: RemoteCut | None = None,
        no_remote_cut: bool = False,
        cut_by_drone: bool = False,
        unlock_phrase: str = UNLOCK_PHRASE,
        clock: Clock = monotonic,
    ) -> None:
        """Start the log of voltage and motors; nothing turns.

        Args:
            drone: open link.
            instruments: checks of the instruments in use (``tachometer.check``), each raises when its
                instrument is lost. They run often, on the stand's own thread, too.
            remote_cut: used when the drone is silent or does not confirm a stop, and by whoever survives us.
            no_remote_cut: the operator was told what that means and lets motors turn without.
            cut_by_drone: our app on the drone must be there instead, which stops them if this program dies.
            unlock_phrase: what the operator must type before anything turns, in small letters.
            clock: host clock [s].

        Raises:
            NoSuchVariable: the firmware has no motorPowerSet. LinkTimeout, LinkLost.
        """
        self._drone = drone
        self._checks = (*instruments, self._check_drone)
        self._remote_cut = remote_cut
        self._may_turn = remote_cut is not None or no_remote_cut
        self._cut_by_drone = cut_by_drone
        self._unlock_phrase = unlock_phrase
        self._clock = clock
        self._renew_within = RENEW_WITHIN_S * drone.patience
        self._silence = _SILENCE_S * drone.patience
        self.stopped: MotorStopReport | None = None
        self._off = drone.param(_ENABLE) == 0  # confirmed, and nothing was commanded since
        self._log = DroneLog(drone, _LOG_NAMES)
        self._stop_lock = threading.Lock()
        self._halted = True  # nothing may turn: locked, or stopped
        self._turning = False
        self._failure: PerchhwError | None = None
        self._renewed = clock()
        self._token = MotorToken(drone, lambda: self._turning, clock)
        self._last_stop = MotorStopReport(
            False, 0.0, "", "nobody waited for the drone's word that they stand"
        )
        self._closing = threading.Event()
        threading.Thread(target=self._watch_motors, name="MotorStand", daemon=True).start()
        # No daemon: the interpreter does not end before the motors stand.
        self._end = threading.Thread(target=self._stop_at_the_end, name="MotorStand's end")
        self._end.start()
        if not self._off:
            self.stop("the override was on already: another program has left it so")

    def unlock(self, phrase: str) -> None:
        """Allow motors to turn, until the next stop that nobody asked for.

        Args:
            phrase: what the operator typed; must be the stand's own.

        Raises:
            MotorsRefused: another phrase; or nobody, or not the drone that has to, could switch the motors
                off if this process died; or the drone is armed or flying, so that its controller would take
                the motors over when the override ends.
            InstrumentLost: who should switch them off is gone.
        """
        if " ".join(phrase.lower().split()) != self._unlock_phrase:
            raise MotorsRefused(f"the motors stay locked: type {self._unlock_phrase!r} when that is so")
        if self._cut_by_drone and not self._token.is_known:
            raise MotorsRefused(
                "the motors stay locked: the drone has no parameter perch.motTok, so that nothing would stop "
                "them if this program died; flash the firmware with our app (docs/firmware.md)"
            )
        if not (self._may_turn or self._cut_by_drone):
            raise MotorsRefused(
                "the motors stay locked: without a supply that can be switched off from here nothing would "
                "stop them if this program died; give a supply, or say that you do without"
            )
        self._beat()
        refuse_armed(self._drone)
        self._failure = None
        self._halted = False

    def spin(self, set_points: Mapping[int, int]) -> None:
        """Turn single motors; the others stop.

        Args:
            set_points: PWM 0..65280 in steps of 256 by motor 1..4.

        Raises:
            InstrumentInputError: no such motor or set-point. MotorsRefused: locked.
            LinkError, InstrumentError: the motors were stopped because of it.
        """
        for motor, value in set_points.items():
            if motor not in _MOTORS:
                raise InstrumentInputError(f"motor {motor}: there are motors 1 to 4")
            check_set_point(value)
        self._apply(_EACH, {motor: set_points.get(motor, 0) for motor in _MOTORS})

    def spin_all(self, set_point: int, *, compensated: bool = False) -> None:
        """Turn all motors at one set-point, PWM 0..65280 in steps of 256.

        `compensated`: as a share of the full thrust, made into PWM by the firmware's thrust map and the
        battery voltage; for the verification. Errors as for :meth:`spin`.
        """
        check_set_point(set_point)
        self._apply(_ALL_COMPENSATED if compensated else _ALL, {1: set_point})

    def renew(self) -> None:
        """Say that somebody still looks after the motors; call at least every 0.4 s while they turn.

        Raises:
            The reason why they were stopped, if they were.
        """
        self._raise_failure()
        self._check_all()
        self._renewed = self._clock()

    def take(self, within_s: float = 1.0) -> LogBatch:
        """Samples of ``pm.vbat`` [V] and ``motor.m1..m4`` [0..65535] since the last call, and a renewal.

        Raises:
            As :meth:`renew`.
        """
        self.renew()
        batch = self._log.take(min(within_s, self._renew_within / 2))
        self.renew()
        return batch

    def stop(self, reason: str = "asked for") -> MotorStopReport:
        """Stop the motors now and read back that they are. Never raises; look at the report."""
        with self._stop_lock:
            self._turning = False
            start = self._clock()
            if self._off and self._drone.lost is not None:
                self.stopped = MotorStopReport(True, 0.0, reason, "")
                return self.stopped
            # A drone that is silent may never hear the stop: do not wait for it with the power on.
            cut = self._power_off() if self._silent() else ""
            trouble = self._stop_drone()
            if trouble and not cut:
                cut = self._power_off()
            trouble = "; ".join(text for text in (trouble, cut) if text) if trouble else ""
            self._off = not trouble
            self.stopped = MotorStopReport(not trouble, self._clock() - start, reason, trouble)
            return self.stopped

    def close(self) -> None:
        """Stop and let go; idempotent.

        Raises:
            MotorsNotStopped: the drone did not confirm.
            KeyboardInterrupt: somebody pressed Ctrl-C meanwhile; the motors are stopped all the same.
        """
        self._closing.set()  # before anything else, for from here on nobody can hold the stop back
        self._halted = True
        interrupt: KeyboardInterrupt | None = None
        while self._end.is_alive():
            try:
                self._end.join()
            except KeyboardInterrupt as key:  # heard when the motors stand
                interrupt = key
        self._let_go()
        if interrupt is not None:
            raise interrupt

    def _stop_at_the_end(self) -> None:
        """A thread's work: who interrupts :meth:`close`, however early or often, does not interrupt this."""
        while not self._closing.wait(_LOOK_S) and threading.main_thread().is_alive():
            pass
        self._closing.set()
        self._last_stop = self.stop("the end of the test")
        self._token.close()
        if self._drone.lost is None:
            with suppress(LinkError):  # lost just now: the block ended with the link
                self._log.close()

    def _let_go(self) -> None:
        last = self._last_stop
        if not last.confirmed:
            raise MotorsNotStopped(f"THE MOTORS MAY STILL TURN, cut the power by hand: {last.trouble}")
        if self._remote_cut is not None:
            self._remote_cut.rest()

    def _apply(self, mode: int, values: Mapping[int, int]) -> None:
        """Write set-points, then the mode. Whatever goes wrong on the way stops the motors."""
        self._raise_failure()
        if self._halted:
            raise MotorsRefused(f"the motors are locked: unlock them with {self._unlock_phrase!r}")
        self._renewed = math.inf  # the link's own deadline bounds a command that is on its way
        self._off = False
        try:
            self._token.begin()
            self._turning = True
            for motor, value in values.items():
                self._drone.set_param(f"motorPowerSet.m{motor}", value)
            self._raise_failure()
            self._drone.set_param(_ENABLE, mode)
        except BaseException as error:
            self._halted = True
            self.stop(f"the command failed: {error}")
            raise
        self._off = False  # a stop meanwhile may have come before the mode
        if self._failure is not None:
            # The watch stopped the motors while the command was on its way: stop them once more.
            self.stop("stopped while a command was on its way")
            self._raise_failure()
        self._renewed = self._clock()

    def _silent(self) -> bool:
        return self._drone.lost is not None or self._drone.silence() > self._silence

    def _stop_drone(self) -> str:
        """Switch the override off and read back; what went wrong, in words, or nothing."""
        trouble = ""
        for _ in range(_STOP_TRIES):
            if self._drone.lost is not None:
                return self._restart_drone(str(self._drone.lost))
            try:
                if _override_off(self._drone):
                    return self._await_zero()
                trouble = "the drone reads back that its override is still on"
            except LinkError as error:
                trouble = str(error)
        return trouble

    def _restart_drone(self, loss: str) -> str:
        """The link is lost: the radio chip, which needs no firmware, can still switch the processor off."""
        try:
            reboot(self._drone.uri, timeout_s=_REBOOT_S, even_flying=True)
        except LinkError as error:
            return f"the link is lost ({loss}), and the drone does not restart ({error})"
        return ""

    def _await_zero(self) -> str:
        """Wait for a log sample with all motors at zero, when the log still runs."""
        within = _ZERO_WITHIN_S * self._drone.patience
        deadline = self._clock() + within
        while True:
            latest = self._log.latest
            if latest is None or self._clock() - latest.receipt_time > within:
                return ""  # no log: the parameter that was read back has to do
            values = [int(latest.values[f"motor.m{motor}"]) for motor in _MOTORS]
            if not any(values):
                return ""
            if self._clock() > deadline:
                return f"the drone took the stop, but its log still shows motors at {values}"
            time.sleep(_LOOK_S / 4)

    def _power_off(self) -> str:
        """Switch the supply off, if there is one in our hands; what came of it, in words."""
        if self._remote_cut is None:
            return ""
        try:
            self._remote_cut.cut()
        except InstrumentError as error:
            return f"the supply did not switch off ({error})"
        return "the supply was switched off instead"

    def _check_drone(self) -> None:
        self._log.check(self._silence)

    def _check_all(self) -> None:
        for check in self._checks:
            check()
        self._token.check()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _beat(self) -> None:
        if self._remote_cut is not None:
            self._remote_cut.beat(HANG_S * self._drone.patience)

    def _watch_motors(self) -> None:
        """The stand's own thread: no renewal, no instrument, no link, no motors.

        It is also the heart: it beats as long as somebody looks after the motors, not as long as the process
        exists.
        """
        while not self._closing.wait(_LOOK_S):
            try:
                self._beat()
                if self._turning:
                    self._check_all()
                    self._check_renewed()
            except PerchhwError as error:
                self._failure, self._halted = error, True
                if self._turning:
                    self.stop(str(error))

    def _check_renewed(self) -> None:
        if self._clock() - self._renewed > self._renew_within:
            raise MotorsRefused(
                f"the motors were stopped: nobody renewed them for {self._renew_within:g} s (the program "
                "hangs, or waits for a key)"
            )


def _override_off(drone: DroneLink) -> bool:
    """Switch the override off; whether the drone reads back that it is."""
    drone.set_param(_ENABLE, 0)
    drone.set_params({f"motorPowerSet.m{motor}": 0 for motor in _MOTORS})
    return drone.param(_ENABLE) == 0
