"""What a person types: units are asked about, never guessed; several readings make one estimate."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.bench.procedures.operator import AnswerNotUsable, Question
from calibration.bench.procedures.readings import estimate_of, parse_reading
from onboard.errors import InputError

DISTANCE = Question("string_distance", "distance of the strings", "m", "mm", (0.02, 0.5), 1e-4)
MASS = Question("mass", "what hangs", "kg", "g", (0.005, 2.0), 2e-5)


@pytest.mark.parametrize(
    ("text", "question", "value"),
    [("60 mm", DISTANCE, 0.06), ("6cm", DISTANCE, 0.06), ("0.06", DISTANCE, 0.06), ("38.1 g", MASS, 0.0381)],
)
def test_a_reading_with_its_unit_is_taken(text: str, question: Question, value: float) -> None:
    assert parse_reading(text, question) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "question", "hint"),
    [
        ("30", DISTANCE, "30 mm"),
        ("60 m", DISTANCE, "60 mm"),
        ("38.1", MASS, "38.1 g"),
        ("30 kg", MASS, "30 g"),
    ],
)
def test_a_unit_that_was_forgotten_or_wrong_is_asked_about(text: str, question: Question, hint: str) -> None:
    with pytest.raises(AnswerNotUsable, match=f"did you mean .*{hint}"):
        parse_reading(text, question)


@pytest.mark.parametrize("text", ["", "abc", "60 mm mm", "3 V", "nan", "60 furlong", "-", "1e999 m"])
def test_what_is_no_reading_is_refused_with_words(text: str) -> None:
    with pytest.raises(InputError):
        parse_reading(text, DISTANCE)


@given(st.text(max_size=12))
def test_any_text_is_a_plausible_value_or_a_clear_refusal(text: str) -> None:
    try:
        value = parse_reading(text, DISTANCE)
    except InputError:
        return
    assert DISTANCE.plausible[0] <= value <= DISTANCE.plausible[1]


def test_the_interval_of_three_readings_holds_the_true_value_as_often_as_it_says() -> None:
    rng = np.random.default_rng(4)
    held, runs = 0, 2000
    for _ in range(runs):
        offset = rng.uniform(-1e-4, 1e-4)  # the ruler's own error
        readings = 0.06 + offset + rng.normal(0.0, 1e-4, 3)
        low, high = estimate_of(readings.tolist(), DISTANCE).interval
        held += low <= 0.06 <= high
    assert 0.93 < held / runs < 0.995


def test_one_reading_has_the_error_of_the_instrument() -> None:
    estimate = estimate_of([0.06], DISTANCE)
    assert estimate.sigma == pytest.approx(1e-4 / math.sqrt(3.0))
    assert math.isinf(estimate.dof)
