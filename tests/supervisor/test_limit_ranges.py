"""What a lab file may make of the limits: the numbers that the documentation shows, and never too loose."""

from dataclasses import fields
from typing import get_type_hints

import pytest

from onboard.quantity import convert
from perchhw.supervisor import Allowed, SafetyLimits, allowed_limits
from tests.conftest import REPOSITORY
from tests.lab_file.range_tables import limits_table, reasons_table

ONLY_STRICTER = {
    "link_silence",
    "pose_age",
    "battery_age",
    "battery_at_rest",
    "battery_in_flight",
    "battery_full",
    "speed_in_test_flight",
    "rotation_in_hover",
    "height_on_ground",
    "wall_margin",
    "latency",
    "braking",
    "descent_silence",
    "descent_disagreement",
    "descent_speed",
    "descent_speed_after_course",
    "descent_tilt",
    "descent_rotation",
    "descent_escape",
}
"""Limits that a watchdog, a pack, a measured delay or a wall sets."""


@pytest.mark.parametrize(
    ("page", "shown"),
    [("lab_file.md", limits_table), ("safety.md", reasons_table)],
    ids=["lab file", "safety"],
)
def test_the_pages_show_these_ranges(page: str, shown: object) -> None:
    assert callable(shown)
    text = (REPOSITORY / "docs" / page).read_text(encoding="utf-8")
    assert f"\n\n{shown()}\n\n" in text, f"docs/{page} should have:\n{shown()}"


def test_every_number_of_the_limits_has_a_range() -> None:
    hints = get_type_hints(SafetyLimits)
    assert set(allowed_limits()) == {item.name for item in fields(SafetyLimits) if hints[item.name] is float}


@pytest.mark.parametrize(("name", "limit"), allowed_limits().items())
def test_what_is_usual_is_allowed_and_loosened_by_a_factor_of_two_at_most(name: str, limit: Allowed) -> None:
    bounds = limit.bounds
    assert getattr(SafetyLimits(), name) == limit.default
    assert bounds.contains(limit.default)
    assert (bounds.least, bounds.most) == tuple(sorted((limit.strictest, limit.loosest)))
    assert limit.default / 2.0 <= limit.loosest <= 2.0 * limit.default
    assert limit.fixed == (name in ONLY_STRICTER) == (limit.loosest == limit.default)
    if bounds.unit == "rad":
        shown = round(convert(limit.loosest, "rad", "deg"))
        assert convert(shown, "deg", "rad") == limit.loosest, "as it comes out of a lab file"


def test_limits_that_belong_together_stay_in_order() -> None:
    """However a lab file chooses, no limit contradicts another one."""
    limits = allowed_limits()
    for lower, higher in (
        ("pose_age", "pose_age_bridged"),
        ("telemetry_age", "descent_silence"),
        ("link_silence", "descent_silence"),
        ("disagreement_on_ground", "disagreement_in_flight"),
        ("disagreement_in_flight", "descent_disagreement"),
        ("tilt_on_ground", "tilt_in_hover"),
        ("tilt_in_hover", "tilt_in_test_flight"),
        ("rotation_in_hover", "rotation_in_test_flight"),
        ("rotation_in_hover", "descent_rotation"),
        ("descent_speed", "descent_speed_after_course"),
        ("battery_in_flight", "battery_at_rest"),
        ("battery_at_rest", "battery_full"),
    ):
        assert limits[lower].bounds.most <= limits[higher].bounds.least
