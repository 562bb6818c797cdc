"""When a drone needs another battery pack, by the voltage model of its vehicle file.

A pack at rest must have what the preflight check demands, and under the load of the climb what the rules of
the flight demand (docs/safety.md).
"""

from dataclasses import dataclass

from onboard.battery import battery_current, open_circuit_voltage, terminal_voltage
from onboard.gravity import GRAVITY
from onboard.trajectory import ACCELERATION_Z_CHOICES, ApproachPlan
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.campaign.plan import CampaignPlan
from perchhw.lab import limits_of
from perchhw.supervisor import SafetyLimits, Timing

MARGIN = 0.02
"""V above the limits at which a pack is changed: the drone measures to half a percent."""
_SHORTEST_MOVE = 2.0
"""s. A move between hovers takes no less (perchhw.supervisor.hovering)."""
TO_THE_START = Timing().take_off + 2.0 * Timing().hover_hold + _SHORTEST_MOVE
"""s in the air until an approach or a course begins."""


@dataclass(frozen=True)
class PackModel:
    """What flights take out of the pack of one vehicle.

    Attributes:
        full: V of a charged pack at rest.
        fall: V by which its voltage at rest falls for each second in the air.
        least: V at rest with which an attempt may begin.
    """

    full: float
    fall: float
    least: float

    @classmethod
    def of(cls, vehicle: Vehicle, limits: SafetyLimits, climb: float) -> "PackModel":
        """The model of `vehicle`, whose approaches accelerate upwards by up to `climb` (m/s2)."""
        battery, weight = vehicle.battery, vehicle.body.mass.value * GRAVITY
        slope, capacity = battery.open_circuit_slope.value, battery.capacity.value
        full, per_newton = battery.open_circuit_full.value, battery.motor_current_per_newton.value
        hover = battery_current(per_newton, *[0.25 * weight] * 4)
        sag = full - terminal_voltage(full, battery.resistance.value, hover * (1.0 + climb / GRAVITY))
        return cls(
            full=full,
            fall=full - open_circuit_voltage(full, slope, capacity, hover),
            least=MARGIN + max(limits.battery_at_rest, limits.battery_in_flight + sag),
        )

    @classmethod
    def for_plan(cls, plan: CampaignPlan) -> "PackModel":
        """The model of the vehicle of a campaign."""
        limits = limits_of(plan.lab, plan.room, plan.drone)
        climb = plan.approach.get("az", max(ACCELERATION_Z_CHOICES))
        return cls.of(load_vehicle(plan.vehicle, plan.legs), limits, climb)

    def after(self, at_rest: float, air_time: float) -> float:
        """Voltage at rest (V) of a pack that had `at_rest` (V) and then flew for `air_time` (s)."""
        return at_rest - self.fall * air_time

    def enough(self, at_rest: float) -> bool:
        """Whether an attempt may begin with a pack of this voltage at rest (V)."""
        return at_rest >= self.least


def air_time(approach: ApproachPlan) -> float:
    """How long the motors turn in an attempt, s: take-off, hovers, the way to the start, the approach."""
    return TO_THE_START + float(approach.impact_time)
