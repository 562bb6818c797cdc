"""The supply's second remote control: the dialect of Korad, whose commands have no ends.

``VSET1:3.70``, ``ISET1:5.000``, ``OUT1``, ``OUT0``; ``*IDN?``, ``VSET1?``, ``ISET1?``, ``VOUT1?``,
``IOUT1?``, ``STATUS?`` (one byte: bit 0 constant voltage, bit 6 output on). What is out of
range is clipped and not complained about.
"""

import re
from collections.abc import Callable

from sim_backend.bench.power import PowerStage

IDENTITY = b"KORADKA3005P V2.0"
VOLTAGE_MAX, CURRENT_MAX = 31.0, 5.1
_COMMAND = re.compile(r"(\*IDN|VSET1|ISET1|VOUT1|IOUT1|STATUS)\?|OUT([01])|([VI])SET1:(\d+\.\d{2,3})")
_CONSTANT_VOLTAGE, _OUTPUT = 0x01, 0x40


class SimulatedKoradSupply:
    """The supply as its second port shows it: :meth:`receive` bytes, get bytes."""

    def __init__(self, supply: PowerStage) -> None:
        self._supply = supply
        self._answers: dict[str, Callable[[], bytes]] = {
            "*IDN": lambda: IDENTITY,
            "VSET1": lambda: b"%05.2f" % supply.voltage,
            "ISET1": lambda: b"%05.3f" % supply.current_limit,
            "VOUT1": lambda: b"%05.2f" % supply.terminal,
            "IOUT1": lambda: b"%05.3f" % supply.current,
            "STATUS": self._status,
        }

    def receive(self, data: bytes) -> bytes:
        """Take the commands in what the computer sent at once, and answer them."""
        return b"".join(self._do(command) for command in _COMMAND.finditer(data.decode("ascii", "replace")))

    def _do(self, command: re.Match[str]) -> bytes:
        question, output, which, value = command.groups()
        supply = self._supply
        if question:
            return self._answers[question]()
        if output:
            supply.output = output == "1"
        elif which == "V":
            supply.voltage = min(float(value), VOLTAGE_MAX)
        else:
            supply.current_limit = min(float(value), CURRENT_MAX)
        return b""

    def _status(self) -> bytes:
        held = 0 if self._supply.limiting else _CONSTANT_VOLTAGE
        return bytes([held | (_OUTPUT if self._supply.output else 0)])
