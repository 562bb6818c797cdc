"""What pose and gyro can say of a landing."""

from enum import StrEnum


class Touch(StrEnum):
    """What met the ceiling first."""

    FEET = "feet"
    BODY = "body"
    UNCLEAR = "unclear"


class Hold(StrEnum):
    """What holds the vehicle."""

    FOUR_LEG = "four_leg"
    TWO_LEG = "two_leg"
    NONE = "none"
