"""Which steps of the ladder a drone has passed today: a small file in the user's state folder."""

import os
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from onboard.errors import InputError, SafetyStop
from onboard.json_file import parsed, write_json_atomically
from perchhw.errors import FlightStackError

STEPS = ("motors", "tilt", "hover", "step", "approach", "landing")
"""The ladder, from below."""


class StepRefused(FlightStackError, SafetyStop):
    """A step of the ladder whose steps below have not passed today, or that the lab is not ready for."""


class PassesNotKept(FlightStackError, InputError):
    """The file of the passes cannot be written; the message names it, the reason and what to do."""


def passes_file() -> Path:
    """``$XDG_STATE_HOME/perchhw/bringup.json``, or below ``~/.local/state``; it may not exist yet."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "perchhw" / "bringup.json"


@dataclass(frozen=True)
class Passes:
    """The passes of one drone, as one vehicle, on one day.

    Attributes:
        drone: its URI.
        vehicle_crc: CRC of the vehicle's constants: another propeller is another drone.
        day: on which they count.
        file: where they are kept.
        own_law: our law flies its hovers: what the firmware's PID has shown says nothing of that.
    """

    drone: str
    vehicle_crc: int
    day: date
    file: Path
    own_law: bool = False

    @property
    def passed(self) -> tuple[str, ...]:
        """Steps that have passed, from below. A file that cannot be read has none."""
        kept = self._read().get(self._key, [])
        return tuple(step for step in STEPS if step in kept)

    def require(self, step: str) -> None:
        """Refuse `step` when one below it has not passed.

        Raises:
            StepRefused: the message names the lowest that is missing.
        """
        passed = self.passed
        for below in STEPS[: STEPS.index(step)]:
            if below not in passed:
                raise StepRefused(
                    f"{step} is refused: {below} has not passed on this drone today; "
                    f"first `perchhw bringup --step {below}`"
                )

    def begin(self, step: str) -> None:
        """Take back `step` and all above it: they count when they have passed anew.

        Raises:
            PassesNotKept: the file cannot be written: nothing is begun that could not be noted.
        """
        below = STEPS[: STEPS.index(step)]
        self._keep([passed for passed in self.passed if passed in below])

    def add(self, step: str) -> None:
        """Note that `step` has passed.

        Raises:
            PassesNotKept: the file cannot be written.
        """
        self._keep([*self.passed, step])

    @property
    def _key(self) -> str:
        address = self.drone.partition("?")[0]  # what follows is the clock of a simulated lab
        law = " own law" if self.own_law else ""
        return f"{address} {self.vehicle_crc:08x}{law} {self.day.isoformat()}"

    def _keep(self, steps: list[str]) -> None:
        kept = {key: old for key, old in self._read().items() if key.endswith(self.day.isoformat())}
        kept[self._key] = steps
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            write_json_atomically(self.file, kept)
        except OSError as error:
            raise PassesNotKept(
                f"{self.file}: what has passed cannot be kept ({error.strerror}); name a folder that can be "
                "written, with XDG_STATE_HOME"
            ) from error

    def _read(self) -> dict[str, list[str]]:
        try:
            document = parsed(self.file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        kept = document if isinstance(document, dict) else {}
        return {key: steps for key, steps in kept.items() if isinstance(steps, list)}
