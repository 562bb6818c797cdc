"""Faults that the simulated bench shows on request: ``--fault bench_NAME=VALUE``.

Times count from the start of the bench in simulated s. The faults of the line (resets, spoilt bytes, stalls)
act on the tachometer and on the scale alike; the supply has a line that nothing happens to.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

from sim_backend.bench.errors import BenchInputError

INSTRUMENTS = ("tachometer", "scale", "supply", "balance", "korad")
NEVER = math.inf


@dataclass(frozen=True, slots=True)
class Window:
    """A span of bench time (s)."""

    start: float
    end: float

    def covers(self, time: float) -> bool:
        """Whether the span includes `time`."""
        return self.start <= time < self.end


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
    stall: Window = Window(NEVER, NEVER)
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
    link_loss: Window = Window(NEVER, NEVER)
    touch: float = 0.0
    draught: float = 0.0
    swing: float | None = None

    @classmethod
    def parse(cls, texts: Mapping[str, str]) -> Self:
        """Faults by their command-line names: ``{"bench_flip": "0.01", ...}``.

        Raises:
            BenchInputError: an unknown name or a value that cannot be used.
        """
        values: dict[str, object] = {}
        for name, text in texts.items():
            if name not in _PARSERS:
                raise BenchInputError(
                    f"no fault of the bench is named {name!r}; known: {', '.join(_PARSERS)}"
                )
            parse, meaning = _PARSERS[name]
            try:
                values[name.removeprefix(PREFIX)] = parse(text)
            except ValueError as error:
                raise BenchInputError(f"--fault {name}={text}: {error} ({name}={meaning})") from error
        return cls(**values)  # type: ignore[arg-type] # each parser gives its field's type


PREFIX = "bench_"


def _number(low: float, high: float) -> Callable[[str], float]:
    def parse(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise ValueError(f"must be between {low:g} and {high:g}")
        return value

    return parse


def _integer(*allowed: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        value = int(text)
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(map(str, allowed))}")
        return value

    return parse


def _flag(text: str) -> bool:
    if text not in ("0", "1"):
        raise ValueError("must be 1 or 0")
    return text == "1"


def _line_ends(text: str) -> str:
    if text not in ("lf", "crlf", "mix"):
        raise ValueError("must be lf, crlf or mix")
    return text


def _times(text: str) -> tuple[float, ...]:
    return tuple(_TIME(part) for part in text.split(","))


def _window(missing: float) -> Callable[[str], Window]:
    def parse(text: str) -> Window:
        start, colon, length = text.partition(":")
        begin = _TIME(start)
        return Window(begin, begin + (_TIME(length) if colon else missing))

    return parse


def _unplugging(text: str) -> Unplugging:
    instrument, colon, at = text.partition(":")
    if instrument not in INSTRUMENTS or not colon:
        raise ValueError(f"must be {'|'.join(INSTRUMENTS)}:S")
    return Unplugging(instrument, _TIME(at))


_TIME = _number(0.0, math.inf)
_CHANCE = _number(0.0, 1.0)

_PARSERS: dict[str, tuple[Callable[[str], object], str]] = {
    "bench_reset_at_open": (_number(0.0, 10.0), "S: opening a port resets its board, silent for S"),
    "bench_reset_at": (_times, "S[,S...]: tachometer and scale reset"),
    "bench_cut_line": (_CHANCE, "P: probability that the end of a line is lost"),
    "bench_merge_line": (_CHANCE, "P: probability that a line's end mark is lost"),
    "bench_garbage": (_CHANCE, "P: probability that a line has NUL and 0xFF bytes mixed in"),
    "bench_flip": (_CHANCE, "P: probability that a bit of a byte turns over"),
    "bench_line_ends": (_line_ends, "lf|crlf|mix: how lines end"),
    "bench_protocol": (_integer(1, 2), "1|2: lines checked by XOR (default) or by CRC-16"),
    "bench_stall": (_window(0.3), "S[:DURATION]: nothing arrives, then all at once (default 0.3 s)"),
    "bench_unplug": (_unplugging, "INSTRUMENT:S: tachometer, scale or supply is pulled out"),
    "bench_wrong_device": (_flag, "1: the ports of tachometer and scale are mixed up"),
    "bench_wrap_in": (_number(0.0, 4294.0), "S: micros() wraps round S after each start of a board"),
    "bench_missed": (_CHANCE, "P: probability that an edge is missed (default 0.003)"),
    "bench_doubled": (_CHANCE, "P: probability that an edge counts twice (default 0.001)"),
    "bench_resonator": (_number(-0.02, 0.02), "E: relative error of the boards' clocks"),
    "bench_blades": (_integer(1, 2, 3, 4), "N: marks that pass in a revolution (default 2)"),
    "bench_flicker": (_number(50.0, 1000.0), "HZ: the tachometer sees the mains light only"),
    "bench_overflow_at": (_TIME, "S: the tachometer's buffer overflows once"),
    "bench_missing_propeller": (_integer(0, 1, 2, 3, 4), "N: motor N has no propeller"),
    "bench_scale_rate": (_integer(10, 80), "10|80: conversions a second (default 80)"),
    "bench_scale_stuck_at": (_TIME, "S: the scale repeats one value"),
    "bench_scale_saturated_at": (_TIME, "S: the scale's converter is at its limit"),
    "bench_scale_off_at": (_TIME, "S: the scale's converter loses its power"),
    "bench_inverted": (_flag, "1: thrust pulls the scale instead of pushing it"),
    "bench_drift": (_number(-20.0, 20.0), "G: drift of the scale while it warms up (default 0.15)"),
    "bench_current_limit": (_number(0.0, 100.0), "A: the supply never gives more"),
    "bench_supply_error": (_flag, "1: the supply has an error in its queue"),
    "bench_lead_resistance": (_number(0.0, 5.0), "OHM: leads from supply to drone (default 0.03)"),
    "bench_on_battery": (_flag, "1: the drone runs on its battery on the stands, too"),
    "bench_gauge_error": (_number(-0.1, 0.1), "E: relative error of the drone's battery reading"),
    "bench_link_loss": (_window(math.inf), "S[:DURATION]: the radio carries nothing"),
    "bench_touch": (_number(0.0, 0.5), "ZETA: the pendulum rubs, damping ratio"),
    "bench_draught": (_number(0.0, 10.0), "A: draught at the pendulum, rad/s2 in 1 s"),
    "bench_swing": (_number(0.0, 1.0), "SHARE: part of a twist that goes into swinging"),
}

BENCH_HELP = {name: meaning for name, (_, meaning) in _PARSERS.items()}
"""What each fault of the bench takes and does, by name."""
