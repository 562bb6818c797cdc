"""What an uncertain room does to the trigger: the policy decides on tau = D_ceil / V_z.

    u(tau) = sqrt(u(D)^2 / V_z^2 + u(latency)^2)

D_ceil is the height of the ceiling above the body's origin: of the plane at the impact point, and of the
body in its markers. What the estimate is late by is tau too small by as much.
"""

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TriggerError:
    """Standard uncertainties of the time to contact at the trigger, s.

    Attributes:
        climb: m/s, V_z.
        ceiling, markers, latency: of tau, from each.
    """

    climb: float
    ceiling: float
    markers: float
    latency: float

    @property
    def tau(self) -> float:
        """All together."""
        return math.sqrt(self.ceiling**2 + self.markers**2 + self.latency**2)

    def json_shape(self) -> dict[str, Any]:
        """95 % uncertainties, s."""
        return {
            "climb_m_s": self.climb,
            **{
                f"u95_{name}_s": 1.96 * getattr(self, name)
                for name in ("tau", "ceiling", "markers", "latency")
            },
        }


def trigger_error(
    speed: float, angle_deg: float, ceiling_sigma: float, markers_sigma: float, latency_sigma: float
) -> TriggerError:
    """At `speed` (m/s) along a line `angle_deg` above the horizon; heights in m, latency in s."""
    climb = speed * math.sin(math.radians(angle_deg))
    return TriggerError(climb, ceiling_sigma / climb, markers_sigma / climb, latency_sigma)
