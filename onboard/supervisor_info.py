"""The drone's own supervisor as it reports itself: bits of CRTP port 9 and of the log ``supervisor.info``.

Layout as in bitcraze/crazyflie-firmware 2026.08, ``supervisor.c`` (bit 11 is not known to cflib 0.1.34).
"""

from dataclasses import dataclass
from enum import IntFlag


class SupervisorBits(IntFlag):
    """Bits of the supervisor's report."""

    CAN_ARM = 1 << 0
    ARMED = 1 << 1
    AUTO_ARM = 1 << 2
    CAN_FLY = 1 << 3
    FLYING = 1 << 4
    TUMBLED = 1 << 5
    LOCKED = 1 << 6
    CRASHED = 1 << 7
    HIGH_LEVEL_ACTIVE = 1 << 8
    HIGH_LEVEL_FINISHED = 1 << 9
    HIGH_LEVEL_DISABLED = 1 << 10
    DECK_FAULT = 1 << 11


@dataclass(frozen=True, slots=True)
class SupervisorInfo:
    """One report of the drone's supervisor. It has no default: no answer is an error, never "all is well"."""

    bits: int

    @property
    def can_arm(self) -> bool:
        """The preflight checks passed."""
        return bool(self.bits & SupervisorBits.CAN_ARM)

    @property
    def is_armed(self) -> bool:
        """The motors are armed."""
        return bool(self.bits & SupervisorBits.ARMED)

    @property
    def auto_arm(self) -> bool:
        """This build arms by itself."""
        return bool(self.bits & SupervisorBits.AUTO_ARM)

    @property
    def can_fly(self) -> bool:
        """The motors may turn."""
        return bool(self.bits & SupervisorBits.CAN_FLY)

    @property
    def is_flying(self) -> bool:
        """Thrust was above idle within the last 2 s."""
        return bool(self.bits & SupervisorBits.FLYING)

    @property
    def is_tumbled(self) -> bool:
        """The drone lies on its side or upside down."""
        return bool(self.bits & SupervisorBits.TUMBLED)

    @property
    def is_locked(self) -> bool:
        """Only a reboot helps."""
        return bool(self.bits & SupervisorBits.LOCKED)

    @property
    def is_crashed(self) -> bool:
        """The drone tumbled in flight; it needs a recovery command while upright."""
        return bool(self.bits & SupervisorBits.CRASHED)
