"""Units: what converts, and what measures something else."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.quantity import UnitError, convert, si_unit


@given(st.text(max_size=20))
def test_any_text_is_a_unit_or_a_unit_error(text: str) -> None:
    try:
        unit, factor = si_unit(text)
    except UnitError:
        return
    assert factor > 0.0
    assert si_unit(unit) == (unit, 1.0)


@pytest.mark.parametrize(
    ("value", "unit", "target", "expected"),
    [
        (38.1, "g", "kg", 0.0381),
        (5.0, "gf", "N", 0.04903325),
        (3.23, "gf/V2", "N/V2", 3.23 * 9.80665e-3),
        (180.0, "deg", "rad", math.pi),
        (180.0, "deg/s", "rad/s", math.pi),
        (250.0, "mAh", "C", 900.0),
        (0.08, "N m/rad", "N m/rad", 0.08),
        (2.0, "kg mm2", "kg m2", 2e-6),
        (1.0, "V", "W/A", 1.0),
        (50.0, "%", "1", 0.5),
    ],
)
def test_units_convert(value: float, unit: str, target: str, expected: float) -> None:
    assert convert(value, unit, target) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("unit", "target"), [("N m", "N m/rad"), ("g", "gf"), ("1/s", "rad/s"), ("Hz", "s")])
def test_units_of_other_kinds_do_not_convert(unit: str, target: str) -> None:
    with pytest.raises(UnitError, match="does not measure"):
        convert(1.0, unit, target)
