"""The bits of the drone's supervisor, against the layout of the firmware."""

import pytest

from onboard.supervisor_info import SupervisorBits, SupervisorInfo

LAYOUT = {
    0: ("CAN_ARM", "can_arm"),
    1: ("ARMED", "is_armed"),
    2: ("AUTO_ARM", "auto_arm"),
    3: ("CAN_FLY", "can_fly"),
    4: ("FLYING", "is_flying"),
    5: ("TUMBLED", "is_tumbled"),
    6: ("LOCKED", "is_locked"),
    7: ("CRASHED", "is_crashed"),
    8: ("HIGH_LEVEL_ACTIVE", None),
    9: ("HIGH_LEVEL_FINISHED", None),
    10: ("HIGH_LEVEL_DISABLED", None),
    11: ("DECK_FAULT", None),
}
"""Number of each bit in the firmware (2026.08), its name, and who reads it."""

ANSWERS = [answer for _, answer in LAYOUT.values() if answer is not None]


@pytest.mark.parametrize("bit", LAYOUT)
def test_each_bit_answers_its_own_question_and_no_other(bit: int) -> None:
    name, answer = LAYOUT[bit]
    assert SupervisorBits[name] == 2**bit
    alone, all_but = SupervisorInfo(2**bit), SupervisorInfo(0xFFFF - 2**bit)
    assert [question for question in ANSWERS if getattr(alone, question)] == [answer] * (answer is not None)
    assert [question for question in ANSWERS if not getattr(all_but, question)] == [answer] * (
        answer is not None
    )


def test_the_layout_is_complete() -> None:
    assert {bit.name for bit in SupervisorBits} == {name for name, _ in LAYOUT.values()}
