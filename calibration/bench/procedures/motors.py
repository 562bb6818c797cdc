"""The tachometer wizard: clamp, align, step the motors, and their speed law comes out."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from calibration.bench.instruments.errors import MotorsRefused
from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE, MotorStand
from calibration.bench.instruments.set_points import pwm
from calibration.bench.instruments.tachometer import Tachometer, TachometerBatch
from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.clock import ClockFit
from calibration.bench.motors.files import read_commands, read_tachometer, write_commands, write_edges
from calibration.bench.motors.monitor import EdgeMonitor, EdgeQuality
from calibration.bench.motors.propellers import PropellerMap
from calibration.bench.motors.tachometer_result import TachometerResult
from calibration.bench.procedures.inertia import PlanError
from calibration.bench.procedures.motor_recording import (
    MIDDLE,
    MotorRecording,
    counted,
    duration,
    record_staircase,
    staircase,
    wait_for_standstill,
)
from calibration.bench.procedures.operator import Gauge, Light, Operator, Question, Task
from calibration.bench.procedures.run_book import Json, RunBook
from calibration.errors import CalibrationError
from calibration.measurement import Estimate, Finding, Severity, rejected
from onboard.battery import FULL_RATIO, thrust_from_voltage
from onboard.gravity import GRAVITY
from onboard.vehicle import Vehicle

KIND = "tachometer"
BLADES = Question("blades", "blades of the propeller (marks per revolution)", "1", "1", (1.0, 6.0), 0.0)
SAFETY = "Motors will turn. Propeller guard on, drone clamped, fingers and hair away."
NO_REMOTE_CUT = (
    "Nothing here can cut the power. If this program is killed or hangs, or the computer dies, the motors "
    "run on until the battery is pulled or empty: no watchdog and no emergency stop of the drone ends them. "
    "Keep a hand on the plug whenever a motor turns. A supply with a serial port (--supply scpi:///dev/..., "
    "korad:///dev/...) is switched off by itself."
)
HAND_PHRASE = "hand on the battery plug"
TRIES = 3

_ALIGN_S = 3.0
_SHARE_LIMIT = 0.02
"""Missed or doubled edges above it are worth aligning the sensor again (bench notes 1.2)."""
_SAG_LIMIT_V = 0.15
_SPREAD = 0.03
"""Relative standard deviation between motors of one kind (estimate of the bench notes), where only one was
measured."""


class SensorNotAligned(CalibrationError):
    """The optical sensor never gave clean pulses."""


@dataclass(frozen=True)
class MotorPlan:
    """What is to be measured.

    Attributes:
        vehicle: as it is believed to be; its mass gives the hover thrust.
        propeller: speed to thrust of the propellers that are fitted.
        motors: of 1 to 4, in their order.
        repeats: of the staircase.
        seed: of the order of its rounds.
    """

    vehicle: Vehicle
    propeller: PropellerMap
    motors: str = "1234"
    repeats: int = 2
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse motors that do not exist."""
        if not self.motors or not set(self.motors) <= set("1234") or len(set(self.motors)) < len(self.motors):
            raise PlanError(f"motors {self.motors!r}: write each of 1, 2, 3, 4 once, as 1234")

    def settings(self) -> Json:
        """What must stay the same when a run goes on."""
        return {
            "vehicle": self.vehicle.name,
            "propeller": self.propeller.name,
            "motors": self.motors,
            "repeats": self.repeats,
            "seed": self.seed,
        }

    @property
    def hover_thrust(self) -> float:
        """N per motor."""
        return self.vehicle.body.mass.value * GRAVITY / 4.0

    def reach(self, motor_voltage: float) -> float | None:
        """rad/s that the vehicle file gives at a motor voltage (V); None where it does not say it."""
        motors = self.vehicle.motors
        if motors.thrust_coefficient is None:
            return None
        thrust = thrust_from_voltage(motors.thrust_map_compiled(), motor_voltage)
        return math.sqrt(max(thrust, 0.0) / motors.thrust_coefficient.value)


def confirm_no_remote_cut(operator: Operator, wanted: bool) -> None:
    """Let motors turn without a supply that can be switched off from here: wanted, told, confirmed.

    Raises:
        MotorsRefused: not wanted. NotConfirmed: not confirmed.
    """
    if not wanted:
        raise MotorsRefused(
            "no motor turns without a supply that can be switched off when this program dies: give one with "
            "a port to --supply (scpi:///dev/..., korad:///dev/...), or say --no-remote-cut and stand at the "
            "battery plug"
        )
    operator.warn(NO_REMOTE_CUT)
    operator.confirm("The battery can be pulled while motors turn.", HAND_PHRASE)


class MotorWizard:
    """Leads through the motors.

    Args:
        plan: what is measured.
        stand: of the motors; this wizard has the operator unlock it.
        tachometer: open.
    """

    def __init__(self, plan: MotorPlan, stand: MotorStand, tachometer: Tachometer) -> None:
        self._plan = plan
        self._stand = stand
        self._tachometer = tachometer

    def run(self, book: RunBook) -> None:
        """All steps that are not done yet; the operator confirms that motors may turn, each time anew.

        Raises:
            NotConfirmed: nothing was started. Paused, StepBack: the operator's wish.
            SensorNotAligned, InstrumentError, LinkError, MotorsRefused: the motors are stopped.
        """
        book.operator.confirm(SAFETY, UNLOCK_PHRASE)
        book.step("blades", "The propeller", lambda: {"blades": book.operator.measure(BLADES)})
        for number in map(int, self._plan.motors):
            book.step(
                f"align-{number}", f"Point the sensor at motor {number}", partial(self._align, book, number)
            )
            book.step(f"steps-{number}", f"Motor {number} up and down", partial(self._steps, book, number))

    def _align(self, book: RunBook, motor: int) -> Json:
        operator, blades = book.operator, round(book.steps["blades"]["blades"][0])
        text = (
            f"Clamp the drone with its propeller guard, the sensor at the marked propeller of motor {motor}. "
            "The motor will turn at half voltage."
        )
        for _ in range(TRIES):
            operator.do(Task("clamp", text, {"motor": motor}))
            quality = self._look(operator, motor, blades)
            trouble = _trouble(quality)
            if not trouble:
                return {
                    "speed": quality.speed,
                    "missed": quality.missed_share,
                    "doubled": quality.doubled_share,
                }
            operator.warn(f"{trouble}: move the sensor closer, shade it, renew the white mark")
        raise SensorNotAligned(
            f"motor {motor}: no clean pulses in {TRIES} tries; look at sensor, mark and lamp"
        )

    def _look(self, operator: Operator, motor: int, blades: int) -> EdgeQuality:
        """The pulses at half voltage."""
        monitor = EdgeMonitor(blades)
        self._stand.unlock(UNLOCK_PHRASE)
        self._tachometer.start()
        self._tachometer.take(0.0)
        batches: list[TachometerBatch] = []
        begin: float | None = None
        now = 0.0
        self._stand.spin({motor: pwm(MIDDLE)})
        with operator.live(f"Motor {motor} at half voltage") as show:
            while begin is None or now < begin + _ALIGN_S:
                batch = self._tachometer.take(0.1)
                self._stand.renew()
                for time in batch.beat_times[-1:]:
                    now = float(time)
                    begin = now if begin is None else begin
                    monitor.tick(now)
                batches.append(batch)
                record = counted(batches)
                first = record.times.size - batch.edges.size
                monitor.add(record.times[first:], record.counts[first:])
                show(_gauges(monitor.quality()))
        self._stand.stop("aligned")
        wait_for_standstill(self._tachometer)
        return monitor.quality()

    def _steps(self, book: RunBook, motor: int) -> Json:
        operator = book.operator
        levels = staircase(np.random.default_rng([self._plan.seed, motor]), self._plan.repeats)
        operator.tell(f"{len(levels)} steps in {duration(levels):.0f} s. Ctrl-C stops the motor.")
        self._stand.unlock(UNLOCK_PHRASE)
        with operator.live(f"Motor {motor}") as show:
            recording = record_staircase(
                self._stand,
                self._tachometer,
                motor,
                levels,
                lambda batch, number, count: show(
                    [
                        Gauge("step", f"{number + 1} of {count}"),
                        Gauge("edges", f"{batch.edges.size / 0.1:5.0f} a second"),
                    ]
                ),
            )
        wait_for_standstill(self._tachometer)
        for finding in _supply_findings(recording, motor):
            operator.warn(finding.text)
        scale = recording.clock.scale
        return {
            "edges": book.keep_raw(f"motor{motor}-edges", partial(write_edges, record=recording.edges)),
            "commands": book.keep_raw(
                f"motor{motor}-commands", partial(write_commands, record=recording.commands)
            ),
            "clock": {
                "scale": scale.value,
                "sigma": scale.sigma,
                "dof": scale.dof,
                "span": recording.clock.span,
            },
            "voltage": [list(pair) for pair in recording.voltage],
            "lost": recording.lost,
            "overflow": recording.overflow,
        }


def _trouble(quality: EdgeQuality) -> str:
    if not quality.edge_rate > 0.0 or not math.isfinite(quality.missed_share):
        return "no pulses"
    if quality.missed_share > _SHARE_LIMIT:
        return f"{100.0 * quality.missed_share:.1f} % of the pulses are missing (limit 2 %)"
    if quality.doubled_share > _SHARE_LIMIT:
        return f"{100.0 * quality.doubled_share:.1f} % of the pulses come twice (limit 2 %)"
    return ""


def _gauges(quality: EdgeQuality) -> list[Gauge]:
    rows = [
        Gauge("edges", f"{quality.edge_rate:5.0f} a second"),
        Gauge("speed", f"{quality.speed:5.0f} rad/s"),
    ]
    if math.isfinite(quality.missed_share):
        for name, share in (("missed", quality.missed_share), ("doubled", quality.doubled_share)):
            light = Light.GREEN if share < _SHARE_LIMIT else Light.RED
            rows.append(Gauge(name, f"{100.0 * share:.2f} % (below 2)", light))
    return rows


def _supply_findings(recording: MotorRecording, motor: int) -> list[Finding]:
    """Voltages at one level belong together; what falls by more is a weak supply or an empty battery."""
    volts = [voltage for _, voltage in recording.voltage]
    sag = max(volts) - min(volts)
    if sag <= _SAG_LIMIT_V:
        return []
    text = (
        f"motor {motor}: the board's voltage moved by {sag:.2f} V between steps (limit {_SAG_LIMIT_V} V); "
        "use a regulated supply of 6 A with short leads and 1000 uF at the board"
    )
    return [Finding("supply_sag", Severity.WARNING, text)]


@dataclass(frozen=True)
class MotorFits:
    """What a run gives.

    Attributes:
        results: by motor.
        sag: largest relative fall of the board's voltage between the steps of a motor.
        raw: recordings that were used.
    """

    results: dict[int, TachometerResult]
    sag: float
    raw: list[dict[str, str]]

    @property
    def findings(self) -> list[Finding]:
        """Of all motors."""
        return [one for result in self.results.values() for one in result.findings]

    @property
    def rejected(self) -> bool:
        """Whether a motor's recording cannot be used."""
        return rejected(self.findings)

    def mean(self, estimates: Sequence[Estimate], follows_voltage: bool = True) -> Estimate:
        """Of the motors that were measured, as what a vehicle file says of all four.

        The uncertainty is that of the mean of four: what each measurement leaves open, how much motors differ
        (their own scatter; for one or two, the usual one), and what the supply does. A voltage that sags
        while a motor speeds up moves the speed it heads for, and the square of that drives it: up to twice
        the sag, the same for all motors.

        Args:
            estimates: one a motor.
            follows_voltage: whether the sag of the supply acts on this quantity.
        """
        count = len(estimates)
        values = np.array([one.value for one in estimates])
        mean = float(values.mean())
        own = math.sqrt(sum(one.sigma**2 for one in estimates)) / count
        scatter = float(values.std(ddof=1)) if count > 2 else _SPREAD * abs(mean)
        unseen = math.sqrt(max(1.0 / count - 0.25, 0.0)) * scatter
        supply = 2.0 * self.sag / math.sqrt(3.0) * abs(mean) if follows_voltage else 0.0
        sigma = math.sqrt(own**2 + unseen**2 + supply**2)
        return Estimate(mean, estimates[0].unit, sigma, min(one.dof for one in estimates))


def fit_motors(folder: Path, steps: Mapping[str, Any], plan: MotorPlan) -> MotorFits:
    """The speed laws of a run, from its folder.

    Raises:
        TachometerError: no steps in a recording, or it cannot be read.
    """
    blades = round(steps["blades"]["blades"][0])
    results, raw, sag = {}, [], 0.0
    for motor in map(int, plan.motors):
        kept = steps.get(f"steps-{motor}") or {}
        if not kept:
            continue
        clock = kept["clock"]
        commands = read_commands(folder / kept["commands"]["file"])
        volts = [voltage for _, voltage in kept["voltage"]]
        results[motor] = analyse(
            [read_tachometer(folder / kept["edges"]["file"])],
            plan.propeller,
            plan.hover_thrust,
            blades,
            ClockFit(Estimate(clock["scale"], "1", clock["sigma"], clock["dof"]), clock["span"]),
            commands=commands,
            overflow=kept["overflow"],
            reach=plan.reach(max(volts) * float(commands.commands.max()) / FULL_RATIO),
        )
        raw += [kept["edges"], kept["commands"]]
        sag = max(sag, 1.0 - min(volts) / max(volts))
    return MotorFits(results, sag, raw)
