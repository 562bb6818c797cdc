"""Record a hung drone over its own log protocol: at rest, and after a twist, with live feedback."""

import math

import numpy as np

from calibration.bench.inertia.live import LiveState, LiveSwing, LiveView
from calibration.bench.inertia.swing import Swing
from calibration.bench.instruments.gyro_recorder import GyroBatch, GyroRecorder, join
from calibration.bench.procedures.operator import Gauge, Light, Operator
from calibration.errors import CalibrationError
from onboard.arrays import Vector

REST_S = 10.0
HAND_CYCLES = 1.0
"""After the release: what the hand did to the first cycle is left out."""
QUIET_S, QUIET_RAD_S = 1.5, 0.1
"""A drone that turns less than this for so long is quiet enough to be twisted."""
PATIENCE_S = 120.0
"""Of the drone's time: without a twist for so long, something is wrong."""
_SWING_LIMITS = (0.03, 0.10)
"""Share of the swing from which it is worth a warning, and from which the trial will not count."""


class NothingMoved(CalibrationError):
    """The operator did not twist the drone, or did not stop it, or its gyro does not see it."""


def record_rest(recorder: GyroRecorder, operator: Operator, axis: Vector, name: str) -> Swing:
    """The next :data:`REST_S` seconds of the drone's time.

    Raises:
        LinkLost, InstrumentLost: samples no longer come.
    """
    recorder.take(0.0)
    batches: list[GyroBatch] = []
    with operator.live("At rest") as show:
        while not batches or _span(batches) < REST_S:
            batch = recorder.take()
            if batch.times.size:
                batches.append(batch)
                largest = float(np.max(np.ptp(join(batches).rates, axis=0)))
                show([_still(_span(batches), largest)])
    return _swing(join(batches), axis, name)


def _span(batches: list[GyroBatch]) -> float:
    return float(batches[-1].times[-1] - batches[0].times[0])


def _still(seconds: float, largest: float) -> Gauge:
    text = f"{seconds:4.1f} of {REST_S:g} s, rates within {largest:.3f} rad/s"
    return Gauge("still", text, Light.GREEN if largest < 0.1 else Light.AMBER)


def wait_until_quiet(recorder: GyroRecorder, operator: Operator) -> None:
    """Return when the drone has hung quietly for :data:`QUIET_S`; what came before is thrown away.

    Raises:
        NothingMoved: it did not come to rest for :data:`PATIENCE_S` of the drone's time.
        LinkLost, InstrumentLost: samples no longer come.
    """
    recorder.take(0.0)
    begin: float | None = None
    recent: list[GyroBatch] = []
    with operator.live("Stop it with a finger") as show:
        while True:
            batch = recorder.take()
            if not batch.times.size:
                continue
            now = float(batch.times[-1])
            begin = float(batch.times[0]) if begin is None else begin
            recent = [*(one for one in recent if one.times[-1] > now - QUIET_S), batch]
            rates = join(recent).rates
            largest = float(np.max(np.abs(rates - np.median(rates, axis=0))))
            quiet = largest < QUIET_RAD_S
            text = f"{largest:.3f} rad/s (below {QUIET_RAD_S:g})"
            show([Gauge("rate", text, Light.GREEN if quiet else Light.AMBER)])
            if quiet and now - begin >= QUIET_S:
                return
            if now - begin > PATIENCE_S:
                raise NothingMoved(f"the drone did not come to rest in {PATIENCE_S:g} s: what moves it?")


def record_swing(recorder: GyroRecorder, operator: Operator, axis: Vector, name: str, cycles: float) -> Swing:
    """From the release on until enough cycles are in, or the amplitude is used up.

    Raises:
        NothingMoved: no release for :data:`PATIENCE_S` of the drone's time.
        LinkLost, InstrumentLost: samples no longer come.
    """
    live = LiveSwing(cycles + HAND_CYCLES)
    batches: list[GyroBatch] = []
    release: float | None = None
    with operator.live("Twist 5 to 12 deg and let go") as show:
        view = live.view
        while view.state is not LiveState.ENOUGH:
            batch = recorder.take()
            for time, rate in zip(batch.times.tolist(), batch.rates.tolist(), strict=True):
                view = live.add(time, (rate[0], rate[1], rate[2]))
                if release is None and view.cycles >= HAND_CYCLES:
                    release = time
            if batch.times.size:
                batches.append(batch)
                show(gauges(view, cycles + HAND_CYCLES))
            if release is None and batches and _span(batches) > PATIENCE_S:
                raise NothingMoved(
                    f"no swing for {PATIENCE_S:g} s: twist the drone by 5 to 12 deg about the vertical and "
                    "let it go; if it did turn, the strings or the gyro are not what the wizard thinks"
                )
    whole = _swing(join(batches), axis, name)
    return whole.between(release if release is not None else -math.inf, math.inf)


def gauges(view: LiveView, enough: float) -> list[Gauge]:
    """What a person sees while the drone swings."""
    degrees = math.degrees(view.amplitude)
    rows = [
        Gauge("state", view.state.value),
        Gauge("cycles", f"{view.cycles:4.1f} of {enough:g}"),
        Gauge("amplitude", f"{degrees:4.1f} deg (2 to 20)", Light.GREEN if view.in_band else Light.AMBER),
    ]
    if view.period is not None:
        rows.append(Gauge("period", f"{view.period:.3f} s"))
    if view.swing_share is not None:
        warn, reject = _SWING_LIMITS
        light = Light.GREEN if view.swing_share < warn else Light.AMBER
        light = light if view.swing_share < reject else Light.RED
        rows.append(Gauge("swing", f"{100.0 * view.swing_share:.1f} % (below 3)", light))
    return rows


def _swing(batch: GyroBatch, axis: Vector, name: str) -> Swing:
    return Swing(batch.times, batch.rates, name, batch.accelerations, "drone", axis)
