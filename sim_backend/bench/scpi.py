"""The supply's remote control: SCPI lines in, SCPI lines out, with an error queue.

Commands in long or short form, any case: ``*IDN?``, ``*CLS``, ``*RST``, ``VOLT``, ``VOLT?``, ``CURR``,
``CURR?``, ``OUTP``, ``OUTP?``, ``MEAS:VOLT?``, ``MEAS:CURR?``, ``SYST:ERR?`` (SCPI-99, volume 2).
"""

from collections import deque
from collections.abc import Callable

import numpy as np

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.power import PowerStage

IDENTITY = "PERCHHW,SIMULATED SUPPLY,0001,1.0"
VOLTAGE_MAX, CURRENT_MAX = 20.0, 10.0
QUEUE_LENGTH = 20
METER_V, METER_A = 0.002, 0.003
"""Standard deviations of the supply's own meters."""

_SHORT = {"VOLTAGE": "VOLT", "CURRENT": "CURR", "OUTPUT": "OUTP", "MEASURE": "MEAS", "SYSTEM": "SYST"}
_SHORT |= {"ERROR": "ERR", "SOURCE": "SOUR", "STATE": "STAT"}
_IGNORED = ("SOUR", "LEV", "LEVEL", "IMM", "IMMEDIATE", "AMPL", "AMPLITUDE", "STAT", "NEXT", "DC")
"""Parts of a header that may be left out."""


class SimulatedScpiSupply:
    """The supply as its port shows it: :meth:`receive` bytes, get bytes."""

    def __init__(self, supply: PowerStage, rng: np.random.Generator, faults: BenchFaults) -> None:
        self._supply = supply
        self._rng = rng
        self._buffer = b""
        self._errors: deque[str] = deque()
        if faults.supply_error:
            self._error(-330, "Self-test failed")
        self._queries: dict[str, Callable[[], str]] = {
            "*IDN": lambda: IDENTITY,
            "*OPC": lambda: "1",
            "VOLT": lambda: f"{supply.voltage:.4f}",
            "CURR": lambda: f"{supply.current_limit:.4f}",
            "OUTP": lambda: str(int(supply.output)),
            "MEAS:VOLT": lambda: f"{self._measured(supply.terminal, METER_V):.4f}",
            "MEAS:CURR": lambda: f"{self._measured(supply.current, METER_A):.4f}",
            "SYST:ERR": self._next_error,
        }

    def receive(self, data: bytes) -> bytes:
        """Take what the computer sent, and answer its complete lines."""
        self._buffer += data
        answers = b""
        while b"\n" in self._buffer:
            text, _, self._buffer = self._buffer.partition(b"\n")
            replies = [
                reply
                for command in text.decode("ascii", "replace").strip().split(";")
                if command.strip() and (reply := self._execute(command.strip())) is not None
            ]
            if replies:
                answers += ";".join(replies).encode("ascii") + b"\n"
        return answers

    def _execute(self, command: str) -> str | None:
        head, _, argument = command.partition(" ")
        name = _header(head.removesuffix("?"))
        if head.endswith("?"):
            query = self._queries.get(name)
            if query is not None:
                return query()
            self._error(-113, "Undefined header")
            return None
        self._set(name, argument.strip().upper())
        return None

    def _set(self, name: str, argument: str) -> None:
        supply = self._supply
        if name == "*CLS":
            self._errors.clear()
        elif name == "*RST":
            supply.voltage, supply.current_limit, supply.output = 3.7, 1.0, False
        elif name == "VOLT":
            supply.voltage = self._number(argument, VOLTAGE_MAX, supply.voltage)
        elif name == "CURR":
            supply.current_limit = self._number(argument, CURRENT_MAX, supply.current_limit)
        elif name == "OUTP" and argument in ("ON", "1", "OFF", "0"):
            supply.output = argument in ("ON", "1")
        elif name == "OUTP":
            self._error(-224, "Illegal parameter value")
        else:
            self._error(-113, "Undefined header")

    def _number(self, text: str, most: float, present: float) -> float:
        """The argument; the present value, and an error in the queue, when it cannot be used."""
        try:
            value = float(text.rstrip("VA "))
        except ValueError:
            self._error(-104, "Data type error")
            return present
        if not 0.0 <= value <= most:
            self._error(-222, "Data out of range")
            return present
        return value

    def _measured(self, value: float, deviation: float) -> float:
        return value + deviation * float(self._rng.standard_normal())

    def _error(self, code: int, text: str) -> None:
        if len(self._errors) == QUEUE_LENGTH:
            self._errors[-1] = '-350,"Queue overflow"'
        else:
            self._errors.append(f'{code},"{text}"')

    def _next_error(self) -> str:
        return self._errors.popleft() if self._errors else '0,"No error"'


def _header(text: str) -> str:
    """A header in short form without its optional parts."""
    parts = [_SHORT.get(part, part) for part in text.upper().lstrip(":").split(":")]
    return ":".join(part for part in parts if part not in _IGNORED)
