"""Whoever commands us by MAVLink is told no: the drone is flown by its supervisor alone."""

from typing import Any

from mocap_bridge.mavlink.endpoint import MESSAGES, ReceivedMessage

_HARMLESS = frozenset({"HEARTBEAT", "TIMESYNC", "SYSTEM_TIME", "COMMAND_ACK", "MISSION_ACK", "STATUSTEXT"})
_KEPT = 200


class Refusals:
    """Answers to what asks us to do something.

    Args:
        system: our system id; what is meant for another one is not ours to refuse.
    """

    def __init__(self, system: int) -> None:
        self._system = system
        self._told: set[tuple[str, int, int]] = set()

    def answer(self, received: ReceivedMessage) -> tuple[Any | None, str | None]:
        """The protocol's way to say no, where it has one, and words, once a sender and kind.

        Returns:
            (acknowledgement, text); None where there is nothing to say.
        """
        message, kind = received.message, received.message.get_type()
        target = getattr(message, "target_system", getattr(message, "target", None))
        if kind in _HARMLESS or target not in (0, self._system):
            return None, None
        asked = (_name(message), received.system, received.component)
        text = None
        if asked not in self._told and len(self._told) < _KEPT:
            self._told.add(asked)
            text = f"refused {asked[0]} from {received.system}/{received.component}: no commands by MAVLink"
        return self._acknowledgement(received), text

    def _acknowledgement(self, received: ReceivedMessage) -> Any | None:
        message, kind = received.message, received.message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            return MESSAGES.MAVLink_command_ack_message(
                message.command,
                MESSAGES.MAV_RESULT_DENIED,
                0,
                0,
                target_system=received.system,
                target_component=received.component,
            )
        if kind.startswith("MISSION_"):
            return MESSAGES.MAVLink_mission_ack_message(
                received.system,
                received.component,
                MESSAGES.MAV_MISSION_DENIED,
                getattr(message, "mission_type", 0),
            )
        return None


def _name(message: Any) -> str:
    command = getattr(message, "command", None)
    return str(message.get_type() if command is None else f"{message.get_type()} {command}")


def timesync_answer(message: Any, now: float) -> Any | None:
    """The answer to a TIMESYNC request at local time `now` (s); None to what is an answer itself."""
    if message.get_type() != "TIMESYNC" or message.tc1 != 0:
        return None
    return MESSAGES.MAVLink_timesync_message(round(now * 1e9), message.ts1)
