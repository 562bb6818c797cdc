"""Faults that the simulated bench shows on request: ``--fault bench_NAME=VALUE``.

Times count from the start of the bench in simulated s. The faults of the line (resets, spoilt bytes, stalls)
act on the tachometer and on the scale alike; the supply has a line that nothing happens to.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from sim_backend.fault_values import (
    CHANCE,
    NEVER,
    NO_TIME,
    TIME,
    FaultRule,
    FaultRules,
    FaultWindow,
    choice,
    fault_values,
    flag,
    integer,
    number,
    times,
    window,
)

INSTRUMENTS = ("tachometer", "scale", "supply", "balance", "korad")


@dataclass(frozen=True, slots=True)
class Unplugging:
    """An instrument that is pulled out at a time (s)."""

    instrument: str
    at: float


@dataclass(frozen=True, slots=True)
class BenchFaults:
    """What goes wrong on the bench; each name with the prefix ``bench_`` is a fault of the command line.

    Attributes:
        reset_at_open: opening the port resets the microcontroller, which is silent for so long (s), then
            sends remains of its bootloader and of a line. None: opening does nothing.
        reset_at: the microcontrollers reset at these times (s).
        cut_line: probability that the end of a line is lost.
        merge_line: probability that a line's end mark is lost.
        garbage: probability a line that NUL and 0xFF bytes are mixed in.
        flip: probability a byte that one of its bits turns over.
        line_ends: ``lf``, ``crlf`` or ``mix``.
        protocol: of the lines, 1 or 2.
        stall: nothing arrives in this span; what was meant for it follows in one burst.
        unplug: an instrument is pulled out.
        wrong_device: the ports of tachometer and scale are mixed up.
        wrap_in: the microcontrollers' micros() starts this long (s) before it wraps round. None: at 0.
        missed, doubled: probability that an edge is missed, or counted twice.
        resonator: relative error of the microcontrollers' clocks. None: drawn, up to 0.5 %.
        blades: marks that pass the sensor in a revolution, whatever the person believes.
        flicker: the sensor sees the mains light flicker (Hz) and nothing else. None: it does not.
        overflow_at: the tachometer's buffer overflows once at this time (s).
        missing_propeller: number of a motor (1..4) without a propeller, 0: none.
        scale_rate: conversions of the scale's converter a second, 10 or 80.
        scale_stuck_at, scale_saturated_at, scale_off_at: the converter repeats one value, is at its limit, or
            is powered down from this time (s) on.
        inverted: the scale is pulled instead of pushed.
        drift: what the scale's zero drifts by while it warms up, g.
        current_limit: the supply never gives more than this, A, whatever it is told.
        supply_error: the supply has an error in its queue.
        lead_resistance: of the leads from supply to drone, ohm.
        on_battery: the drone runs on its battery also where it should be on the supply.
        gauge_error: relative error of the drone's own battery reading. None: drawn, 1 %.
        link_loss: the radio carries nothing in this span.
        touch: damping ratio of a pendulum that rubs against something.
        draught: standard deviation of the pendulum's acceleration by draught, rad/s2 in 1 s.
        swing: share of the twist that goes into swinging. None: drawn, 2 to 5 %.
    """

    reset_at_open: float | None = None
    reset_at: tuple[float, ...] = ()
    cut_line: float = 0.0
    merge_line: float = 0.0
    garbage: float = 0.0
    flip: float = 0.0
    line_ends: str = "lf"
    protocol: int = 1
    stall: FaultWindow = NO_TIME
    unplug: Unplugging | None = None
    wrong_device: bool = False
    wrap_in: float | None = None
    missed: float = 0.003
    doubled: float = 0.001
    resonator: float | None = None
    blades: int = 2
    flicker: float | None = None
    overflow_at: float = NEVER
    missing_propeller: int = 0
    scale_rate: int = 80
    scale_stuck_at: float = NEVER
    scale_saturated_at: float = NEVER
    scale_off_at: float = NEVER
    inverted: bool = False
    drift: float = 0.15
    current_limit: float = NEVER
    supply_error: bool = False
    lead_resistance: float = 0.03
    on_battery: bool = False
    gauge_error: float | None = None
    link_loss: FaultWindow = NO_TIME
    touch: float = 0.0
    draught: float = 0.0
    swing: float | None = None

    @classmethod
    def parse(cls, texts: Mapping[str, str]) -> Self:
        """Faults by their command-line names: ``{"bench_flip": "0.01", ...}``.

        Raises:
            FaultError: an unknown name or a value that cannot be used.
        """
        return cls(**fault_values(texts, BENCH_RULES, PREFIX))


def _unplugging(text: str) -> Unplugging:
    instrument, colon, at = text.partition(":")
    if instrument not in INSTRUMENTS or not colon:
        raise ValueError(f"must be {'|'.join(INSTRUMENTS)}:S")
    return Unplugging(instrument, TIME(at))


PREFIX = "bench_"

BENCH_RULES: FaultRules = {
    "bench_reset_at_open": FaultRule(number(0.0, 10.0), "S: opening a port resets its board, silent for S"),
    "bench_reset_at": FaultRule(times, "S[,S...]: tachometer and scale reset"),
    "bench_cut_line": FaultRule(CHANCE, "P: probability that the end of a line is lost"),
    "bench_merge_line": FaultRule(CHANCE, "P: probability that a line's end mark is lost"),
    "bench_garbage": FaultRule(CHANCE, "P: probability that a line has NUL and 0xFF bytes mixed in"),
    "bench_flip": FaultRule(CHANCE, "P: probability that a bit of a byte turns over"),
    "bench_line_ends": FaultRule(choice("lf", "crlf", "mix"), "lf|crlf|mix: how lines end"),
    "bench_protocol": FaultRule(integer(1, 2), "1|2: lines checked by XOR (default) or by CRC-16"),
    "bench_stall": FaultRule(window(0.3), "S[:DURATION]: nothing arrives, then all at once (default 0.3 s)"),
    "bench_unplug": FaultRule(_unplugging, "INSTRUMENT:S: tachometer, scale or supply is pulled out"),
    "bench_wrong_device": FaultRule(flag, "1: the ports of tachometer and scale are mixed up"),
    "bench_wrap_in": FaultRule(number(0.0, 4294.0), "S: micros() wraps round S after each start of a board"),
    "bench_missed": FaultRule(CHANCE, "P: probability that an edge is missed (default 0.003)"),
    "bench_doubled": FaultRule(CHANCE, "P: probability that an edge counts twice (default 0.001)"),
    "bench_resonator": FaultRule(number(-0.02, 0.02), "E: relative error of the boards' clocks"),
    "bench_blades": FaultRule(integer(1, 2, 3, 4), "N: marks that pass in a revolution (default 2)"),
    "bench_flicker": FaultRule(number(50.0, 1000.0), "HZ: the tachometer sees the mains light only"),
    "bench_overflow_at": FaultRule(TIME, "S: the tachometer's buffer overflows once"),
    "bench_missing_propeller": FaultRule(integer(0, 1, 2, 3, 4), "N: motor N has no propeller"),
    "bench_scale_rate": FaultRule(integer(10, 80), "10|80: conversions a second (default 80)"),
    "bench_scale_stuck_at": FaultRule(TIME, "S: the scale repeats one value"),
    "bench_scale_saturated_at": FaultRule(TIME, "S: the scale's converter is at its limit"),
    "bench_scale_off_at": FaultRule(TIME, "S: the scale's converter loses its power"),
    "bench_inverted": FaultRule(flag, "1: thrust pulls the scale instead of pushing it"),
    "bench_drift": FaultRule(number(-20.0, 20.0), "G: drift of the scale while it warms up (default 0.15)"),
    "bench_current_limit": FaultRule(number(0.0, 100.0), "A: the supply never gives more"),
    "bench_supply_error": FaultRule(flag, "1: the supply has an error in its queue"),
    "bench_lead_resistance": FaultRule(number(0.0, 5.0), "OHM: leads from supply to drone (default 0.03)"),
    "bench_on_battery": FaultRule(flag, "1: the drone runs on its battery on the stands, too"),
    "bench_gauge_error": FaultRule(number(-0.1, 0.1), "E: relative error of the drone's battery reading"),
    "bench_link_loss": FaultRule(window(), "S[:DURATION]: the radio carries nothing"),
    "bench_touch": FaultRule(number(0.0, 0.5), "ZETA: the pendulum rubs, damping ratio"),
    "bench_draught": FaultRule(number(0.0, 10.0), "A: draught at the pendulum, rad/s2 in 1 s"),
    "bench_swing": FaultRule(number(0.0, 1.0), "SHARE: part of a twist that goes into swinging"),
}
"""What each fault of the bench takes and does, by name."""
