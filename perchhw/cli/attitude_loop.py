"""What ``perchhw vehicle check`` says of the attitude loop: its margins, and warnings below their limits."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from onboard.attitude_margins import AttitudeMargins
    from onboard.vehicle import Vehicle


@dataclass(frozen=True)
class AttitudeLoop:
    """Margins of one vehicle.

    Attributes:
        own: with the motor lag of its file.
        by_lag: with other motor lags (s), rising and falling thrust alike, and the delay of its file.
    """

    own: "AttitudeMargins"
    by_lag: dict[float, "AttitudeMargins"]

    def warnings(self) -> list[str]:
        """What is below its limit."""
        cases = {"with the motor lag of the file": self.own}
        cases |= {f"with a motor lag of {1e3 * lag:.0f} ms": margins for lag, margins in self.by_lag.items()}
        return [
            f"the attitude loop {case} has {_words(margins)}, less than {_limits()}: do not fly it on "
            "hardware; check motors.time_constant_up and _down, body.inertia_*, and effects of lag and delay"
            for case, margins in cases.items()
            if not margins.suffice
        ]

    def json_shape(self) -> dict[str, Any]:
        """``attitude_margins`` and ``warnings`` of the document."""
        from onboard.attitude_margins import DELAY_LIMIT, PHASE_LIMIT_DEG

        return {
            "attitude_margins": {
                "own": _json(self.own),
                "by_lag": [{"lag_s": lag, **_json(margins)} for lag, margins in self.by_lag.items()],
                "limits": {"phase_deg": PHASE_LIMIT_DEG, "delay_s": DELAY_LIMIT},
            },
            "warnings": self.warnings(),
        }

    def lines(self) -> list[str]:
        """The same for a person."""
        lags = "; ".join(f"{1e3 * lag:.0f} ms: {_words(margins)}" for lag, margins in self.by_lag.items())
        return [
            f"attitude loop: {_words(self.own)}; wanted {_limits()}",
            f"with other motor lags: {lags}",
            *(f"warning: {warning}" for warning in self.warnings()),
        ]


def attitude_loop(vehicle: "Vehicle") -> AttitudeLoop:
    """The margins of a vehicle."""
    from onboard.attitude_margins import margins_by_lag, vehicle_margins

    return AttitudeLoop(vehicle_margins(vehicle), margins_by_lag(vehicle))


def _json(margins: "AttitudeMargins") -> dict[str, float]:
    return {"phase_deg": margins.phase_deg, "delay_s": margins.delay}


def _words(margins: "AttitudeMargins") -> str:
    return f"{margins.phase_deg:.0f} deg and {1e3 * margins.delay:.0f} ms"


def _limits() -> str:
    from onboard.attitude_margins import DELAY_LIMIT, PHASE_LIMIT_DEG

    return f"{PHASE_LIMIT_DEG:.0f} deg and {1e3 * DELAY_LIMIT:.0f} ms"
