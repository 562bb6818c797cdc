"""The newest readings of a flight, left where the screen's thread picks them up; nothing here waits."""

from collections import deque
from collections.abc import Mapping
from typing import Any

from mocap_bridge.health import PoseVerdict
from onboard.record.recorder import Scalar
from perchhw.supervisor import FlightState, Observation, Phase

PLAN = (
    Phase.CHECKING,
    Phase.UPLOADING,
    Phase.ARMING,
    Phase.TAKING_OFF,
    Phase.MOVING_TO_START,
    Phase.ARMING_APPROACH,
    Phase.APPROACHING,
    Phase.FLIPPING,
    Phase.SETTLING,
    Phase.DISARMING,
)
TEST_FLIGHT_PLAN = (
    Phase.CHECKING,
    Phase.ARMING,
    Phase.TAKING_OFF,
    Phase.MOVING_TO_START,
    Phase.TEST_FLIGHT,
    Phase.LANDING,
    Phase.DISARMING,
)
_TAU_COUNTS = (Phase.APPROACHING, Phase.FLIPPING)
_SPAN_S = 1.0
"""Over which rates are counted, s."""


class _Rate:
    """Counts what comes, and says how often. Counted by one thread, asked by another."""

    def __init__(self) -> None:
        self._newest = (0, 0.0)
        self._seen: deque[tuple[int, float]] = deque(maxlen=64)

    def count(self, t: float) -> None:
        """One more, at `t` (s)."""
        self._newest = (self._newest[0] + 1, t)

    def value(self, now: float) -> float | None:
        """A second, until `now` (s); None before there is a span to count over."""
        self._seen.append((self._newest[0], now))
        while len(self._seen) > 2 and now - self._seen[1][1] >= _SPAN_S:
            self._seen.popleft()
        first, since = self._seen[0]
        return None if now - since < 0.5 * _SPAN_S else (self._newest[0] - first) / (now - since)


class FlightWatch:
    """Takes what a flight gives to displays and listeners; any thread may ask for the readings.

    Attributes:
        state: of the supervisor, the newest; None before the first.
    """

    def __init__(self) -> None:
        self.state: FlightState | None = None
        self._observation = Observation()
        self._phases: tuple[str, ...] = ()
        self._tau: float | None = None
        self._poses, self._estimates = _Rate(), _Rate()

    def phase(self, state: FlightState) -> None:
        """An ``on_phase`` of a flight."""
        self.state = state
        if not self._phases or self._phases[-1] != state.phase.value:
            self._phases = (*self._phases, state.phase.value)

    def look(self, state: FlightState, observation: Observation) -> None:
        """An ``on_look`` of a flight."""
        self.state, self._observation = state, observation

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """A listener of a flight's record."""
        if topic == "pose":
            self._poses.count(t)
        elif topic == "estimate":
            self._estimates.count(t)
        elif topic == "cues":
            tau = values.get("tau")
            self._tau = float(tau) if isinstance(tau, int | float) else None

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """A listener of a flight's record; phases and alerts come by the supervisor's state."""

    def readings(self) -> dict[str, Any]:
        """Fields of :class:`perchhw.screen.snapshot.Snapshot`."""
        state, seen = self.state, self._observation
        if state is None:
            return {"flying": True}
        plan = TEST_FLIGHT_PLAN if Phase.TEST_FLIGHT.value in self._phases else PLAN
        verdict = seen.pose_verdict
        return {
            "flying": state.phase is not Phase.DONE,
            "phases": self._phases,
            "planned": tuple(phase.value for phase in plan),
            "in_phase_s": state.time - state.entered_at,
            "waiting_for": state.waiting_for,
            "alert": state.alert,
            "aborted_by": state.aborted_by,
            "battery_v": seen.battery_voltage,
            "telemetry_hz": self._estimates.value(state.time),
            "silence_s": seen.link_silence,
            "mocap": None
            if verdict is None
            else ("OK" if verdict is PoseVerdict.OK else verdict.name.lower()),
            "mocap_hz": self._poses.value(state.time),
            "mocap_age_s": seen.pose_age,
            "estimate_to_mocap_m": seen.estimate_to_pose,
            "tau_s": self._tau if state.phase in _TAU_COUNTS else None,
            "policy_crc": seen.active_policy_crc,
        }
