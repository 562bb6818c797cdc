"""What feeds the drone: a laboratory supply with leads and a current limit, or its battery."""

from onboard.battery import open_circuit_voltage, terminal_voltage
from onboard.vehicle import Battery
from sim_backend.bench.faults import BenchFaults

ELECTRONICS_A = 0.11
"""What the drone draws with its motors off."""
LIMITER_GAIN = 2.5
"""V/s of output per A above the limit: slow enough for motors that follow in a tenth of a second."""
SOFT_START = 1000.0
"""V/s when nothing limits the current."""
BROWN_OUT_V = 2.4
RECOVERY_V = 2.8


class PowerStage:
    """The power stage of a laboratory supply.

    Attributes:
        voltage, current_limit: as set, V and A.
        output: on or off.
        terminal: V at its terminals now.
        current: A out of it now.
        limiting: whether the current limit holds the voltage down.
    """

    def __init__(self, faults: BenchFaults) -> None:
        self.voltage, self.current_limit = 3.7, 1.0
        self.output = False
        self.terminal = self.current = 0.0
        self.limiting = False
        self._most = faults.current_limit
        self._resistance = faults.lead_resistance

    def feed(self, demand: float, dt: float) -> float:
        """Give `demand` (A) for `dt` (s); the voltage (V) at the other end of the leads."""
        if not self.output:
            self.terminal = self.current = 0.0
            self.limiting = False
            return 0.0
        limit = min(self.current_limit, self._most)
        self.limiting = demand > limit or (self.limiting and self.terminal < self.voltage)
        slope = LIMITER_GAIN * (limit - demand) if self.limiting else SOFT_START
        self.terminal = max(0.0, min(self.voltage, self.terminal + slope * dt))
        self.current = min(demand, limit)
        return max(0.0, self.terminal - self._resistance * self.current)


class Pack:
    """The drone's battery, as :mod:`sim_backend.physics.battery` has it."""

    def __init__(self, battery: Battery, open_circuit: float | None) -> None:
        """`open_circuit`: V of each fresh pack, None for a full one."""
        self._battery = battery
        self._fresh = battery.open_circuit_full.value if open_circuit is None else open_circuit
        self._used = 0.0

    def exchange(self) -> None:
        """A fresh pack."""
        self._used = 0.0

    def feed(self, demand: float, dt: float) -> float:
        """Give `demand` (A) for `dt` (s); the voltage (V) at the board."""
        self._used += demand * dt
        battery = self._battery
        rest = open_circuit_voltage(
            self._fresh, battery.open_circuit_slope.value, battery.capacity.value, self._used
        )
        return float(terminal_voltage(rest, battery.resistance.value, demand))
