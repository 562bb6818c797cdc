"""What a diagnosis says: one cause, what happened and why, what to do next, and the numbers behind it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

Number = float | int | str | None


class Cause(StrEnum):
    """What a flight came to, or what kept it from its landing. Names are kept: scripts read them."""

    FOUR_LEGS = "four_legs"
    FOUR_LEGS_BODY_CONTACT = "four_legs_body_contact"
    TWO_LEGS = "two_legs"
    FLIP_EARLY = "flip_early"
    FLIP_LATE = "flip_late"
    FLIP_WEAK = "flip_weak"
    FLIP_STRONG = "flip_strong"
    CEILING_ELSEWHERE = "ceiling_elsewhere"
    BODY_FIRST = "body_first"
    FEET_LET_GO = "feet_let_go"
    CEILING_NOT_REACHED = "ceiling_not_reached"
    OTHER_POLICY_COMPUTED = "other_policy_computed"
    REGION_MISSED = "region_missed"
    REGION_ELSEWHERE = "region_elsewhere"
    TOO_SLOW = "too_slow"
    NO_CUES = "no_cues"
    MOCAP_OCCLUDED = "mocap_occluded"
    MOCAP_FROZEN = "mocap_frozen"
    MOCAP_JUMPED = "mocap_jumped"
    MOCAP_LATE = "mocap_late"
    MOCAP_SILENT = "mocap_silent"
    ESTIMATE_WRONG = "estimate_wrong"
    LINK_LOST = "link_lost"
    TUMBLED = "tumbled"
    GYRO_BIASED = "gyro_biased"
    BATTERY_LOW = "battery_low"
    OFF_PATH = "off_path"
    LEFT_ROOM = "left_room"
    START_NOT_REACHED = "start_not_reached"
    NOT_READY = "not_ready"
    WRONG_POLICY_LIVE = "wrong_policy_live"
    STOPPED_BY_OTHERS = "stopped_by_others"
    OPERATOR = "operator"
    DRONE_ENDED_IT = "drone_ended_it"
    COMMAND_FAILED = "command_failed"
    NOT_BEGUN = "not_begun"
    PROCESS_KILLED = "process_killed"
    RECORD_LOST = "record_lost"
    HOST_STOOD_STILL = "host_stood_still"
    INTERNAL_ERROR = "internal_error"
    DRY_RUN = "dry_run"
    FLOWN = "flown"
    RULE = "rule"


@dataclass(frozen=True)
class Diagnosis:
    """One finding about one flight.

    Attributes:
        cause: what the flight came to, or what kept it from its landing.
        sentence: what happened and why, in one sentence without a full stop.
        next: what to do now, in one sentence.
        values: the numbers behind it; the unit is the end of each name (``_s``, ``_ms``, ``_m``, ``_deg``).
    """

    cause: Cause
    sentence: str
    next: str
    values: Mapping[str, Number] = field(default_factory=dict)

    def json_shape(self) -> dict[str, Any]:
        """As it stands in ``run.json`` and in the JSON of ``fly``."""
        return {
            "code": self.cause,
            "sentence": self.sentence,
            "next": self.next,
            "values": self.values,
        }

    def in_words(self) -> str:
        """Two lines for a person."""
        return f"{self.sentence}\nnext: {self.next}"
