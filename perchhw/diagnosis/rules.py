"""The safety rules in a person's words: what kind of thing failed, what happened, and what to do about it."""

from enum import StrEnum
from itertools import chain
from typing import Final, NamedTuple

from perchhw.diagnosis.finding import Cause


class AbortKind(StrEnum):
    """What kind of thing ended a flight early. Names are kept: campaign files set limits by them."""

    LINK = "link"
    MOCAP = "mocap"
    BATTERY = "battery"
    DRONE = "drone"
    PATH = "path"
    OTHER = "other"


class RuleWords(NamedTuple):
    """What a broken rule means.

    Attributes:
        cause: it stands for.
        words: what happened.
        next: what to do.
    """

    cause: Cause
    words: str
    next: str


_LINK = "look at antenna, channel and distance, and at the drone's power; then perchhw doctor"
_ESTIMATE = "put the drone level and still on its mark, reboot it, and hold mocap frame against the drone"
_PACK = "charge or change the pack"
_CELLS = "fly a pack of one cell; with one, look at how the drone measures it (perchhw doctor)"
_TUMBLE = "look at propellers and motor order (perchhw bringup --step motors), then at the airframe"
_PATH = "look at thrust, imbalance and mocap (hover first); a wrong mass or centre of mass pulls it aside"
_MARK = "put the drone on its start mark, upright, heading along +x"
_ROOM = "compare room and start mark of the lab file with the room"
_HOST = "end other programs on this computer; never suspend one that flies"
_FIRMWARE = "flash the firmware that belongs to this program (perchhw doctor)"
_REBOOT = "reboot the drone on its start mark, and find out why it stopped"

RULES_BY_KIND: Final[dict[AbortKind, dict[str, RuleWords]]] = {
    AbortKind.LINK: {
        "link_silence": RuleWords(Cause.LINK_LOST, "the drone was not heard any more", _LINK),
        "link_lost": RuleWords(Cause.LINK_LOST, "the link to the drone was lost", _LINK),
        "drone_state_age": RuleWords(Cause.LINK_LOST, "the drone's state did not arrive any more", _LINK),
        "estimate_age": RuleWords(Cause.LINK_LOST, "the drone's estimate did not arrive any more", _LINK),
        "landing_age": RuleWords(Cause.LINK_LOST, "the landing app's state did not arrive any more", _LINK),
        "rates_age": RuleWords(Cause.LINK_LOST, "the drone's gyro did not arrive any more", _LINK),
    },
    AbortKind.MOCAP: {
        "estimate_to_mocap": RuleWords(Cause.ESTIMATE_WRONG, "estimate and mocap disagreed", _ESTIMATE),
        "heading_to_mocap": RuleWords(
            Cause.ESTIMATE_WRONG, "the headings of estimate and mocap disagreed", _ESTIMATE
        ),
        "descent_disagreement": RuleWords(
            Cause.ESTIMATE_WRONG, "estimate and mocap disagreed on the way down", _ESTIMATE
        ),
    },
    AbortKind.BATTERY: {
        "battery_age": RuleWords(Cause.LINK_LOST, "the battery's voltage did not arrive any more", _LINK),
        "battery_at_rest": RuleWords(Cause.BATTERY_LOW, "the pack is not charged", _PACK),
        "battery_in_flight": RuleWords(Cause.BATTERY_LOW, "the pack's voltage gave way under load", _PACK),
        "battery_full": RuleWords(Cause.NOT_READY, "the drone reports more than one cell can have", _CELLS),
    },
    AbortKind.DRONE: {
        "policy_crc_age": RuleWords(Cause.LINK_LOST, "the drone did not name its policy any more", _LINK),
        "drone_state": RuleWords(Cause.TUMBLED, "the drone's own supervisor says that it tumbled", _TUMBLE),
        "drone_can_fly": RuleWords(Cause.DRONE_ENDED_IT, "the drone's supervisor cut the motors", _REBOOT),
        "drone_can_arm": RuleWords(Cause.NOT_READY, "the drone's own checks do not let it arm", _REBOOT),
        "landing_state": RuleWords(Cause.RULE, "the landing app was in a state unknown here", _FIRMWARE),
        "parameters": RuleWords(
            Cause.NOT_READY, "parameters of the drone are not as they must be", "perchhw doctor"
        ),
        "policy_crc": RuleWords(
            Cause.WRONG_POLICY_LIVE,
            "another policy than the uploaded one was live",
            "reboot the drone and upload again",
        ),
    },
    AbortKind.PATH: {
        "tilt_in_hover": RuleWords(Cause.TUMBLED, "the drone tipped over", _TUMBLE),
        "tilt_in_test_flight": RuleWords(Cause.TUMBLED, "the drone tipped over", _TUMBLE),
        "rotation_in_hover": RuleWords(Cause.TUMBLED, "the drone turned too fast", _TUMBLE),
        "rotation_in_test_flight": RuleWords(Cause.TUMBLED, "the drone turned too fast", _TUMBLE),
        "descent_tilt": RuleWords(Cause.TUMBLED, "the drone tipped over on its way down", _TUMBLE),
        "speed_on_ground": RuleWords(
            Cause.ESTIMATE_WRONG, "the estimate moved while the drone stood", _ESTIMATE
        ),
        "descent_rotation": RuleWords(Cause.TUMBLED, "the drone turned too fast on its way down", _TUMBLE),
        "descent_speed": RuleWords(Cause.OFF_PATH, "the drone was too fast on its way down", _PATH),
        "descent_estimate": RuleWords(Cause.ESTIMATE_WRONG, "the estimate was not to be believed", _ESTIMATE),
        "descent_speed_blind": RuleWords(
            Cause.ESTIMATE_WRONG, "the estimate ran away without mocap", _ESTIMATE
        ),
        "corridor": RuleWords(Cause.OFF_PATH, "the place on the path was unknown", _PATH),
        "corridor_distance": RuleWords(Cause.OFF_PATH, "the drone left the planned path", _PATH),
        "corridor_speed": RuleWords(Cause.OFF_PATH, "the drone was not as fast as planned", _PATH),
        "corridor_tilt": RuleWords(Cause.OFF_PATH, "the drone was tilted otherwise than planned", _PATH),
        "speed_in_hover": RuleWords(Cause.OFF_PATH, "the drone was too fast between hovers", _PATH),
        "speed_in_test_flight": RuleWords(Cause.OFF_PATH, "the drone was too fast on its course", _PATH),
        "inside_room": RuleWords(Cause.LEFT_ROOM, "the drone was not inside the room", _ROOM),
        "descent_beyond_walls": RuleWords(Cause.LEFT_ROOM, "the drone left the room on its way down", _ROOM),
        "descent_place": RuleWords(Cause.ESTIMATE_WRONG, "nobody knew where the drone was", _ESTIMATE),
        "flip_in_room": RuleWords(Cause.LEFT_ROOM, "the drone left the room in its flip", _ROOM),
        "flip_height": RuleWords(
            Cause.CEILING_NOT_REACHED, "the drone fell in its flip", "fly faster or steeper"
        ),
        "flip_time": RuleWords(
            Cause.CEILING_NOT_REACHED, "the flip did not come to its end", "fly faster or steeper"
        ),
        "flight_time": RuleWords(
            Cause.RULE, "the flight took too long", "look where it waited in the time line"
        ),
        "tilt_on_ground": RuleWords(Cause.NOT_READY, "the drone does not stand upright", _MARK),
        "height_on_ground": RuleWords(Cause.NOT_READY, "the drone does not stand on the floor", _MARK),
        "start_mark_distance": RuleWords(Cause.NOT_READY, "the drone is not on its start mark", _MARK),
        "start_mark_heading": RuleWords(
            Cause.NOT_READY, "the drone's heading is not that of its mark", _MARK
        ),
    },
    AbortKind.OTHER: {
        "host_stood_still": RuleWords(
            Cause.HOST_STOOD_STILL, "this program stood still in the flight, suspended or kept waiting", _HOST
        ),
    },
}
"""Every rule by its name, sorted by what failed. ``pose`` and ``pose_age`` have no words here: what refused
poses mean is in their verdicts (:mod:`perchhw.diagnosis.mocap`)."""

RULES: Final = dict(chain.from_iterable(rules.items() for rules in RULES_BY_KIND.values()))
KIND_OF_RULE: Final = {name: kind for kind, rules in RULES_BY_KIND.items() for name in rules}
FENCES = RuleWords(Cause.LEFT_ROOM, "the drone came too near to a wall, floor or ceiling", _ROOM)

BROKE_OFF: dict[str, RuleWords] = {
    "tilt": RuleWords(Cause.TUMBLED, "the drone broke off: it tilted too far", _TUMBLE),
    "bad_estimate": RuleWords(
        Cause.ESTIMATE_WRONG, "the drone broke off: its estimate could not be true", _ESTIMATE
    ),
    "off_track": RuleWords(Cause.OFF_PATH, "the drone broke off: it had left its path", _PATH),
    "not_flying": RuleWords(Cause.DRONE_ENDED_IT, "the drone's supervisor ended the flight", _REBOOT),
    "contact": RuleWords(Cause.CEILING_ELSEWHERE, "the drone met the ceiling on its approach", _ROOM),
}
"""Reasons of the landing app, by the name of its ``EndReason``."""
