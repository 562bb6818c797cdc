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
    FaultWindow,
    choice,
    fault,
    fault_rules,
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


def _unplugging(text: str) -> Unplugging:
    instrument, colon, at = text.partition(":")
    if instrument not in INSTRUMENTS or not colon:
        raise ValueError(f"must be {'|'.join(INSTRUMENTS)}:S")
    return Unplugging(instrument, TIME(at))


@dataclass(frozen=True, slots=True)
class BenchFaults:
    """What goes wrong on the bench, each with what the command line takes, with the prefix ``bench_``.

    Where it is None the relative error of the boards' clocks is drawn (up to 0.5 %), that of the drone's
    reading (1 %) and the share of a twist that swings (2 to 5 %); micros() starts at 0, and nothing resets at
    an opening. Where something does, remains of a bootloader and of a line come after the silence.
    """

    reset_at_open: float | None = fault(
        number(0.0, 10.0), "S: opening a port resets its board, silent for S", None
    )
    reset_at: tuple[float, ...] = fault(times, "S[,S...]: tachometer and scale reset", ())
    cut_line: float = fault(CHANCE, "P: probability that the end of a line is lost", 0.0)
    merge_line: float = fault(CHANCE, "P: probability that a line's end mark is lost", 0.0)
    garbage: float = fault(CHANCE, "P: probability that a line has NUL and 0xFF bytes mixed in", 0.0)
    flip: float = fault(CHANCE, "P: probability that a bit of a byte turns over", 0.0)
    line_ends: str = fault(choice("lf", "crlf", "mix"), "lf|crlf|mix: how lines end", "lf")
    protocol: int = fault(integer(1, 2), "1|2: lines checked by XOR (default) or by CRC-16", 1)
    stall: FaultWindow = fault(
        window(0.3), "S[:DURATION]: nothing arrives, then all at once (default 0.3 s)", NO_TIME
    )
    unplug: Unplugging | None = fault(
        _unplugging, "INSTRUMENT:S: tachometer, scale or supply is pulled out", None
    )
    wrong_device: bool = fault(flag, "1: the ports of tachometer and scale are mixed up", False)
    wrap_in: float | None = fault(
        number(0.0, 4294.0), "S: micros() wraps round S after each start of a board", None
    )
    missed: float = fault(CHANCE, "P: probability that an edge is missed (default 0.003)", 0.003)
    doubled: float = fault(CHANCE, "P: probability that an edge counts twice (default 0.001)", 0.001)
    resonator: float | None = fault(number(-0.02, 0.02), "E: relative error of the boards' clocks", None)
    blades: int = fault(integer(1, 2, 3, 4), "N: marks that pass in a revolution (default 2)", 2)
    flicker: float | None = fault(number(50.0, 1000.0), "HZ: the tachometer sees the mains light only", None)
    overflow_at: float = fault(TIME, "S: the tachometer's buffer overflows once", NEVER)
    missing_propeller: int = fault(integer(0, 1, 2, 3, 4), "N: motor N has no propeller", 0)
    scale_rate: int = fault(integer(10, 80), "10|80: conversions a second (default 80)", 80)
    scale_stuck_at: float = fault(TIME, "S: the scale repeats one value", NEVER)
    scale_saturated_at: float = fault(TIME, "S: the scale's converter is at its limit", NEVER)
    scale_off_at: float = fault(TIME, "S: the scale's converter loses its power", NEVER)
    inverted: bool = fault(flag, "1: thrust pulls the scale instead of pushing it", False)
    drift: float = fault(number(-20.0, 20.0), "G: drift of the scale while it warms up (default 0.15)", 0.15)
    current_limit: float = fault(number(0.0, 100.0), "A: the supply never gives more", NEVER)
    supply_error: bool = fault(flag, "1: the supply has an error in its queue", False)
    lead_resistance: float = fault(number(0.0, 5.0), "OHM: leads from supply to drone (default 0.03)", 0.03)
    on_battery: bool = fault(flag, "1: the drone runs on its battery on the stands, too", False)
    gauge_error: float | None = fault(
        number(-0.1, 0.1), "E: relative error of the drone's battery reading", None
    )
    link_loss: FaultWindow = fault(window(), "S[:DURATION]: the radio carries nothing", NO_TIME)
    touch: float = fault(number(0.0, 0.5), "ZETA: the pendulum rubs, damping ratio", 0.0)
    draught: float = fault(number(0.0, 10.0), "A: draught at the pendulum, rad/s2 in 1 s", 0.0)
    swing: float | None = fault(number(0.0, 1.0), "SHARE: part of a twist that goes into swinging", None)

    @classmethod
    def parse(cls, texts: Mapping[str, str]) -> Self:
        """Faults by their command-line names: ``{"bench_flip": "0.01", ...}``.

        Raises:
            FaultError: an unknown name or a value that cannot be used.
        """
        return cls(**fault_values(texts, BENCH_RULES))


BENCH_RULES = fault_rules(BenchFaults, "bench_")
"""What each fault of the bench takes and does, by name."""
