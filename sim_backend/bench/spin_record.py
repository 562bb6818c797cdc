"""When the motors were driven, and how long after the last word from the computer they stopped."""

from dataclasses import dataclass


@dataclass(slots=True)
class Spin:
    """One time of driven motors. All times in s of the bench.

    Attributes:
        place: where the drone was: ``floor``, ``hanging``, ``clamped`` or ``on_scale``.
        started: when the first motor was given a duty.
        stopped: when the last one lost it; None while they turn.
        last_command: when the computer last changed what the motors are told.
        last_packet: when the computer was last heard.
        longest_silence: longest time in which the computer was not heard while motors were driven.
    """

    place: str
    started: float
    stopped: float | None
    last_command: float
    last_packet: float
    longest_silence: float = 0.0


class SpinRecord:
    """All spins of a bench; for tests, which assert on it.

    Attributes:
        spins: oldest first.
        incidents: what would have hurt somebody, in words.
    """

    def __init__(self) -> None:
        self.spins: list[Spin] = []
        self.incidents: list[str] = []
        self._packet = self._command = 0.0

    def heard(self, time: float) -> None:
        """A packet has arrived at `time` (s)."""
        self._packet = time

    def commanded(self, time: float) -> None:
        """The motors' command was changed at `time` (s)."""
        self._command = time

    def step(self, time: float, driven: bool, place: str) -> None:
        """One ms that ends at `time` (s)."""
        spin = self.spins[-1] if self.spins and self.spins[-1].stopped is None else None
        if spin is None:
            if driven:
                self.spins.append(Spin(place, time, None, self._command, self._packet))
            return
        spin.last_command, spin.last_packet = self._command, self._packet
        spin.longest_silence = max(spin.longest_silence, time - max(self._packet, spin.started))
        if not driven:
            spin.stopped = time

    def incident(self, time: float, text: str) -> None:
        """Note what would have hurt; the same thing once only."""
        if not any(noted.endswith(text) for noted in self.incidents):
            self.incidents.append(f"{time:.3f} s: {text}")
