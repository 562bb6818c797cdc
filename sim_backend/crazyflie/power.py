"""The simulated drone's power management: battery voltage as the firmware sees it, level, low-battery state.

Thresholds and times of bitcraze/crazyflie-firmware 2026.08 (``pm_stm32f4.c``): low below ``pm.lowVoltage``
(3.2 V) for 5 s. Automatic shutdown is not part of the default build.
"""

from enum import IntEnum

import numpy as np

LOW_TIMEOUT_MS = 5000
MEASUREMENT_PERIOD_MS = 10
STATE_PERIOD_MS = 100
COMPENSATION_GAIN = 0.01
"""Per ms: the low-pass of the voltage that the battery compensation divides by (``stabilizer.c``)."""

FULL_VOLTAGE = 4.2
"""V: where that low-pass begins."""

_LEVELS_V = (3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10)
"""Voltage at 0 %, 10 % ... 90 % of charge."""


class PowerState(IntEnum):
    """``pm.state``."""

    BATTERY = 0
    CHARGING = 1
    CHARGED = 2
    LOW_POWER = 3
    SHUTDOWN = 4


class PowerManager:
    """Battery monitor of one drone.

    Attributes:
        voltage: last measurement, V.
        supply: low-passed voltage for the battery compensation, V.
        low_voltage: threshold ``pm.lowVoltage``, V.
        offset: what its measurements show too much, V.
    """

    def __init__(self, noise: float, rng: np.random.Generator) -> None:
        """`noise`: standard deviation of one reading, V."""
        self.voltage = 3.7
        self.supply = FULL_VOLTAGE
        self.low_voltage = 3.2
        self.offset = 0.0
        self.state = PowerState.BATTERY
        self._noise = noise
        self._rng = rng
        self._last_good_ms = 0

    def step(self, tick_ms: int, terminal_voltage: float) -> None:
        """Advance by one ms with the true terminal voltage, V."""
        if tick_ms % MEASUREMENT_PERIOD_MS == 0:
            noise = self._noise * float(self._rng.standard_normal())
            self.voltage = terminal_voltage + noise + self.offset
        self.supply += COMPENSATION_GAIN * (self.voltage - self.supply)
        if tick_ms % STATE_PERIOD_MS == 0:
            if self.voltage > self.low_voltage:
                self._last_good_ms = tick_ms
            low = tick_ms - self._last_good_ms > LOW_TIMEOUT_MS
            self.state = PowerState.LOW_POWER if low else PowerState.BATTERY

    @property
    def level(self) -> int:
        """Charge in percent, in steps of ten, from the open-circuit curve."""
        return 10 * min(9, sum(self.voltage > volts for volts in _LEVELS_V))
