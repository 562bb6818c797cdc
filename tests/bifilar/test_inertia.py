"""Several trials to one inertia: budget, interval, jig, tensor, and what looks wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.inertia.errors import RigError
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import InertiaResult, inertia_about_axis
from calibration.bench.inertia.rig import Jig, Rig, check_rig, measured, unit_doubts
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Estimate, combine
from onboard.json_file import as_json
from tests.tiers import some
from tests.truth.bench.pendulum import Hang, record


def exactly(value: float, unit: str) -> Estimate:
    return Estimate(value, unit, 0.0)


def jig_rig(**changes: object) -> Rig:
    hang = Hang()
    rig = Rig(
        measured([hang.mass], 0.02e-3, "kg"),
        measured([hang.top], 0.1e-3, "m"),
        measured([hang.bottom], 0.1e-3, "m"),
        measured([hang.length], 0.5e-3, "m"),
    )
    return replace(rig, **changes)


@pytest.fixture(scope="module")
def fits() -> list[SwingFit]:
    return [fit_swing(record(Hang(), np.random.default_rng(k), 8.0 + k)) for k in range(5)]


def at(fit: SwingFit, periods: list[float]) -> list[SwingFit]:
    """Fits that say `periods` (s) at no amplitude."""
    return [
        replace(fit, period=Estimate(period, "s", 0.0), mean_square_amplitude=0.0, findings=())
        for period in periods
    ]


def codes(result: InertiaResult) -> set[str]:
    return {finding.code for finding in result.findings}


def test_five_trials_give_the_inertia(fits: list[SwingFit]) -> None:
    result = inertia_about_axis(fits, jig_rig(), expected=28e-6)
    assert result.findings == ()
    assert result.formula == pytest.approx(Hang().inertia, rel=1e-4)
    assert result.inertia.value == pytest.approx(Hang().inertia, rel=2e-3)
    assert result.inertia.value < result.formula
    assert 0.003 < result.inertia.u95 / result.inertia.value < 0.007
    shares = [one.share for one in result.budget]
    assert shares == sorted(shares, reverse=True)
    assert result.budget[0].name == "string distance"
    assert combine(result.budget)[0] == pytest.approx(result.inertia.sigma / result.inertia.value)
    assert result.axis == pytest.approx((0.0, 0.0, 1.0), abs=2e-3)


def test_the_budget_is_that_of_the_notes(fits: list[SwingFit]) -> None:
    """Their table, D = 60 mm: jig 0.25 %, ruler 1.0 % (k = 1)."""
    trials = at(fits[0], [Hang().period * (1.0 + 0.001 * d) for d in (-1.26, -0.63, 0.0, 0.63, 1.26)])
    gravity = Estimate(9.803, "m/s2", 0.002)
    assert inertia_about_axis(trials, jig_rig(gravity=gravity)).inertia.sigma / 30e-6 == pytest.approx(
        0.0025, abs=3e-4
    )
    wide = measured([0.06], 0.5e-3, "m")
    ruler = jig_rig(top=wide, bottom=wide, gravity=gravity)
    assert inertia_about_axis(trials, ruler).inertia.sigma / 30e-6 == pytest.approx(0.010, abs=5e-4)


def test_an_even_error_has_a_narrower_interval_than_a_normal_one(fits: list[SwingFit]) -> None:
    wide = measured([0.06], 0.5e-3, "m")
    inertia = inertia_about_axis(fits, jig_rig(top=wide, bottom=wide)).inertia
    assert 1.6 < inertia.u95 / inertia.sigma < 1.8
    assert inertia.interval == pytest.approx((inertia.value - inertia.u95, inertia.value + inertia.u95))


@pytest.mark.parametrize("half_width", some([0.5e-3, 0.1e-3], 2))
def test_the_interval_covers(fits: list[SwingFit], half_width: float) -> None:
    rng = np.random.default_rng(12)
    runs, covered = 60, 0
    for _ in range(runs):
        ruler, offset = rng.uniform(-half_width, half_width), rng.normal(0.0, 0.5e-3)
        hang = Hang(offset=offset, gravity=rng.normal(9.803, 0.01))
        swung = (1.0 + rng.uniform(0.0, 0.002)) * (
            1.0 + rng.choice([-0.4, 0.8]) * math.radians(rng.normal()) ** 2
        )
        trials = at(fits[0], list(hang.period * math.sqrt(swung) * (1.0 + rng.normal(0.0, 0.001, 5))))
        rig = Rig(
            measured([hang.mass + rng.uniform(-2e-5, 2e-5)], 2e-5, "kg"),
            measured([hang.top + ruler], half_width, "m"),
            measured([hang.bottom + ruler], half_width, "m"),
            measured([hang.length + rng.uniform(-5e-4, 5e-4)], 5e-4, "m"),
        )
        inertia = inertia_about_axis(trials, rig).inertia
        covered += inertia.interval[0] <= hang.inertia <= inertia.interval[1]
    assert covered / runs >= 0.88


def test_fewer_than_four_trials_claim_no_interval(fits: list[SwingFit]) -> None:
    result = inertia_about_axis(fits[:3], jig_rig())
    assert "few_trials" in codes(result)
    assert math.isinf(result.inertia.u95)
    assert as_json(result.inertia)["u95"] is None
    assert "few_trials" not in codes(inertia_about_axis(fits[:4], jig_rig()))


def test_trials_that_differ_widen_the_interval_and_are_named(fits: list[SwingFit]) -> None:
    near = at(fits[0], [1.0 + 0.0005 * d for d in (-1, 1, -1, 1)])
    far = at(fits[0], [1.0 + 0.005 * d for d in (-1, 1, -1, 1)])
    rig = jig_rig(top=measured([0.09], 1e-4, "m"))
    narrow, wide = inertia_about_axis(near, rig), inertia_about_axis(far, rig)
    assert "spread" not in codes(narrow)
    assert "spread" in codes(wide)
    assert wide.inertia.u95 > 3.0 * narrow.inertia.u95
    assert wide.budget[0].name == "period"


def test_rejected_trials_do_not_count_unless_told(fits: list[SwingFit]) -> None:
    bad = fit_swing(record(Hang(), np.random.default_rng(3), 10.0, cycles=5.0))
    assert bad.rejected
    assert len(inertia_about_axis([*fits, bad], jig_rig()).trials) == 5
    told = inertia_about_axis([*fits, bad], jig_rig(), accept_rejected=True)
    assert len(told.trials) == 6
    assert "rejected_counts" in codes(told)
    with pytest.raises(RigError, match=r"none of 1 trial"):
        inertia_about_axis([bad], jig_rig())


def test_the_jig_is_subtracted(fits: list[SwingFit]) -> None:
    plain = inertia_about_axis(fits, jig_rig())
    jig = Jig(exactly(4e-3, "kg"), Estimate(5e-6, "kg m2", 1e-7), offset=2e-3)
    result = inertia_about_axis(fits, jig_rig(jig=jig))
    reduced = 4e-3 * (Hang().mass - 4e-3) / Hang().mass
    assert result.inertia.value == pytest.approx(plain.inertia.value - 5e-6 - reduced * 4e-6, rel=1e-9)
    assert result.inertia.sigma / result.inertia.value > plain.inertia.sigma / plain.inertia.value
    assert "jig" in {one.name for one in result.budget}
    with pytest.raises(RigError, match="jig"):
        inertia_about_axis(fits, jig_rig(jig=Jig(exactly(4e-3, "kg"), exactly(40e-6, "kg m2"))))


def test_the_centre_of_mass_off_the_middle_is_expected_to_add(fits: list[SwingFit]) -> None:
    centred = inertia_about_axis(fits, jig_rig(offset_sigma=0.0))
    loose = inertia_about_axis(fits, jig_rig(offset_sigma=3e-3))
    assert loose.inertia.value / centred.inertia.value == pytest.approx(
        1.0 - (2 * 3e-3 / 0.06) ** 2, rel=1e-6
    )
    assert loose.budget[0].name == "centre of mass"


def test_what_cannot_be_is_named(fits: list[SwingFit]) -> None:
    assert "preset" in codes(inertia_about_axis(fits, jig_rig(), expected=12e-6))
    assert "gyration" in codes(inertia_about_axis(fits, jig_rig(top=measured([0.3], 1e-4, "m"))))
    with pytest.raises(RigError, match="reach"):
        inertia_about_axis(fits, jig_rig(length=measured([0.01], 0.0, "m"), top=measured([0.2], 0.0, "m")))


@pytest.mark.parametrize(
    ("name", "changed", "suggested"),
    [
        ("mass", {"mass": 34.0}, 0.034),
        ("string distance at the top", {"top": 60.0}, 0.06),
        ("string distance at the drone", {"bottom": 6.0}, 0.006),
        ("string length", {"length": 600.0}, 0.6),
        ("mass", {"mass": 1e9}, None),
    ],
)
def test_another_unit_is_asked_about_not_guessed(
    name: str, changed: dict[str, float], suggested: float | None
) -> None:
    values = {"mass": 0.034, "top": 0.06, "bottom": 0.06, "length": 0.6}
    assert unit_doubts(**values) == []
    (doubt,) = unit_doubts(**{**values, **changed})
    assert doubt.name == name
    assert doubt.suggested == (None if suggested is None else pytest.approx(suggested))
    assert doubt.question.endswith("?") == (suggested is not None)


def test_a_string_distance_longer_than_the_strings() -> None:
    (doubt,) = unit_doubts(0.034, 0.4, 0.06, 0.3)
    assert "longer than the strings" in doubt.question


def test_units_and_another_battery_reject_the_rig() -> None:
    assert check_rig(jig_rig()) == []
    (unit,) = check_rig(jig_rig(length=exactly(600.0, "m")))
    assert (unit.code, unit.severity.value) == ("unit", "reject")
    assert "600 m, or 0.6 m?" in unit.text
    assert check_rig(jig_rig(mass_after=measured([0.03401], 2e-5, "kg"))) == []
    (changed,) = check_rig(jig_rig(mass_after=measured([0.0352], 2e-5, "kg")))
    assert changed.code == "mass_changed"
    heavy = Jig(exactly(0.05, "kg"), exactly(1e-6, "kg m2"))
    assert [one.code for one in check_rig(jig_rig(jig=heavy))] == ["unit"]


@given(st.lists(st.floats(0.01, 0.1), min_size=1, max_size=6), st.floats(0.0, 1e-3))
def test_readings_combine_as_the_gum_says(readings: list[float], half_width: float) -> None:
    one = measured(readings, half_width, "m")
    scatter = np.var(readings, ddof=1) / len(readings) if len(readings) > 1 else 0.0
    assert one.value == pytest.approx(np.mean(readings))
    assert one.sigma**2 == pytest.approx(scatter + half_width**2 / 3.0, rel=1e-9, abs=1e-30)
    assert one.dof >= len(readings) - 1
    drawn = one.draw(np.random.default_rng(0), 50)
    assert np.isfinite(drawn).all()


@pytest.mark.parametrize(("readings", "half_width"), [([], 0.1), ([math.nan], 0.1), ([1.0], -0.1)])
def test_what_is_no_reading(readings: list[float], half_width: float) -> None:
    with pytest.raises(RigError, match="measure again"):
        measured(readings, half_width, "m")
