"""How the simulated drone was built and equipped, where that may differ from what our app needs."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.errors import InputError
from sim_backend.crazyflie.tables import LogTable, ParameterTable
from sim_backend.errors import SimulationError

FLASH_KB = 1024
_IDENTITY = (0x002D0048, 0x5236500A, 0x20353237)
"""``cpu.id0`` to ``id2``: made up, as every processor has others."""
_DECKS = "deck."
_MULTIRANGER = "bcMultiranger"
_NOTHING_IN_SIGHT = 32767
"""mm; cflib takes 8000 and more for no measurement."""


class BuildError(SimulationError, InputError):
    """A deck that the firmware does not know."""


@dataclass(frozen=True, slots=True)
class Build:
    """Configuration of the firmware.

    Attributes:
        auto_arm: it arms by itself when its preflight checks have passed, as Bitcraze's build for brushed
            motors does (``MOTORS_REQUIRE_ARMING`` off).
        idle_thrust: least ratio 0..65535 of each motor while they may turn (``MOTORS_DEFAULT_IDLE_THRUST``,
            7000 unless configured where arming is required); a client may write ``powerDist.idleThrust``.
        decks: names of attached decks, as in the parameters ``deck.*``. Nothing of what they would measure is
            simulated; a multiranger sees nothing.
    """

    auto_arm: bool = False
    idle_thrust: int = 0
    decks: tuple[str, ...] = ()

    def apply(self, params: ParameterTable) -> None:
        """Set what the firmware knows of itself after booting."""
        params["powerDist.idleThrust"] = self.idle_thrust
        params["imu_sensors.BMP3XX"] = 1
        params["cpu.flash"] = FLASH_KB
        for index, part in enumerate(_IDENTITY):
            params[f"cpu.id{index}"] = part
        for deck in self.decks:
            params[_DECKS + deck] = 1

    def bind(self, logs: LogTable) -> None:
        """Connect what the decks log."""
        if _MULTIRANGER in self.decks:
            for direction in ("front", "back", "left", "right", "up"):
                logs.bind(f"range.{direction}", lambda: _NOTHING_IN_SIGHT)


OURS = Build()
"""As our app needs it, without decks."""


def known_decks(names: Iterable[str]) -> tuple[str, ...]:
    """These decks.

    Raises:
        BuildError: the firmware knows no such deck.
    """
    entries = ParameterTable.firmware(False).entries
    known = sorted(entry.name for entry in entries if f"{entry.group}." == _DECKS)
    decks = tuple(names)
    for deck in decks:
        if deck not in known:
            raise BuildError(f"--deck {deck}: the firmware knows no such deck; known: {', '.join(known)}")
    return decks
