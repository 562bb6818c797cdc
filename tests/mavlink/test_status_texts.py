import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.mavlink.status_texts import LINE_BYTES, REPEATS_S, StatusText, StatusTexts


def heard(texts: StatusTexts, seconds: float) -> list[StatusText]:
    """All lines sent in a time, looked for as often as the thread does."""
    return [line for tick in range(int(seconds / 0.02)) for line in texts.due(100.0 + 0.02 * tick)]


def test_what_is_not_about_safety_is_said_once() -> None:
    texts = StatusTexts()
    texts.say("landing", 6)
    assert heard(texts, 6.0) == [StatusText(6, "landing", 0)]


def test_what_is_about_safety_is_repeated_with_its_number() -> None:
    texts = StatusTexts()
    texts.say("link lost", 2, safety=True)
    texts.say("landing", 2, safety=True)
    lines = heard(texts, 6.0)
    assert lines.count(StatusText(2, "#1 link lost", 1)) == len(REPEATS_S)
    assert lines.count(StatusText(2, "#2 landing", 2)) == len(REPEATS_S)
    assert heard(texts, 6.0) == []


@pytest.mark.parametrize("seed", range(5))
def test_a_link_that_loses_a_third_loses_no_safety_event(seed: int) -> None:
    rng = np.random.default_rng(seed)
    texts = StatusTexts()
    said = [f"event {i} " + "with words " * 8 for i in range(400)]
    arrived: dict[int, str] = {}
    for number, text in enumerate(said):
        texts.say(text, 2, safety=True)
        for tick in range(300):
            for line in texts.due(6.0 * number + 0.02 * tick):
                if rng.random() >= 0.3:
                    arrived[line.number] = line.text.partition(" ")[2]
    together = " ".join(text for _, text in sorted(arrived.items()))
    assert together == " ".join(" ".join(said).split())


@given(st.lists(st.text(max_size=400), max_size=100), st.booleans())
def test_any_text_fits_and_memory_is_bounded(said: list[str], safety: bool) -> None:
    texts = StatusTexts()
    for text in said:
        texts.say(text, 3, safety=safety)
    lines = list(texts.due(0.0))
    assert len(lines) <= 64 * 8
    assert all(0 < len(line.text.encode()) <= LINE_BYTES for line in lines)
