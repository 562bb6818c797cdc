"""What a check holds: each quantity, how it repeats from day to day, and what would settle a change."""

import math
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class HeldQuantity:
    """One line of a check.

    Attributes:
        what: its name in the JSON document and in the history.
        meaning: in words.
        repeats: standard deviation from day to day of a drone that is the same, in the line's unit; ours,
            until a lab's own days say it (:func:`perchhw.hover_check.judge.against_days`).
        settles: what to do about a change.
        shown: factor and unit in which a person reads it.
        more_is_wrong: only a larger value is a change.
        relative: `repeats` is a share of the value.
        late_with_computer: a computer that is too busy for the flight makes it wrong, too.
    """

    what: str
    meaning: str
    repeats: float
    settles: str
    shown: tuple[float, str] = (1.0, "")
    more_is_wrong: bool = False
    relative: bool = False
    late_with_computer: bool = False


_PROPELLER: Final = "exchange that propeller, then that motor; centre battery and markers; "
_MOCAP: Final = "perchhw mocap calibrate, and perchhw mocap watch"
_PERCENT: Final = (100.0, "%")
_MS: Final = (1e3, "ms")
_DEG: Final = (math.degrees(1.0), "deg")
_DEG_S: Final = (math.degrees(1.0), "deg/s")

HELD: Final = (
    HeldQuantity(
        "thrust",
        "thrust of the hover by commands, voltage and thrust map, of the weight",
        0.01,
        "weigh the drone with its battery; then perchhw calibrate thrust",
        _PERCENT,
    ),
    *(
        HeldQuantity(
            f"motor_{motor}",
            f"thrust that motor {motor} is asked for, of that of its fellows",
            0.01,
            f"{_PROPELLER}perchhw calibrate tachometer",
            _PERCENT,
        )
        for motor in (1, 2, 3, 4)
    ),
    HeldQuantity(
        "motor_lag",
        "time constants of the motors, of those of the vehicle file",
        0.1,
        "perchhw calibrate tachometer",
        _PERCENT,
    ),
    HeldQuantity(
        "battery_resistance",
        "fall of the voltage at take-off over the current",
        0.012,
        "fly another pack, clean the plug; then perchhw calibrate discharge",
        (1e3, "mohm"),
    ),
    HeldQuantity(
        "vibration_gyro",
        "gyro above 30 Hz, rms",
        0.12,
        "balance or exchange propellers one after another; is everything glued on?",
        _DEG_S,
        more_is_wrong=True,
        relative=True,
    ),
    HeldQuantity(
        "vibration_accelerometer",
        "accelerometer above 30 Hz, rms",
        0.12,
        "balance or exchange propellers one after another; is everything glued on?",
        (1.0, "m/s2"),
        more_is_wrong=True,
        relative=True,
    ),
    HeldQuantity("mocap_rate", "poses a second", 0.5, _MOCAP, (1.0, "Hz"), late_with_computer=True),
    *(
        HeldQuantity(what, meaning, repeats, _MOCAP, shown, more_is_wrong=True, late_with_computer=True)
        for what, meaning, repeats, shown in (
            ("mocap_missing", "share of the frames that never came", 0.003, _PERCENT),
            ("mocap_longest_gap", "longest time without a pose", 0.006, _MS),
            ("mocap_age", "age of the poses at receipt", 0.001, _MS),
            ("mocap_jitter", "of that age, 95 of 100 poses", 0.001, _MS),
        )
    ),
    HeldQuantity(
        "mocap_latency",
        "delay of the poses that nobody reports",
        0.0015,
        _MOCAP,
        _MS,
        late_with_computer=True,
    ),
    *(
        HeldQuantity(
            f"mocap_turn_{axis}",
            f"turn of the tracked frame about the body's {axis}",
            0.004,
            "were markers bent or the subject defined anew? perchhw mocap calibrate",
            _DEG,
        )
        for axis in "xyz"
    ),
    *(
        HeldQuantity(
            f"gyro_bias_{axis}",
            f"bias of the gyro about {axis}",
            0.003,
            "restart the drone on a table that stands still; warm it up first",
            _DEG_S,
        )
        for axis in "xyz"
    ),
)
"""In the order in which they are shown."""
