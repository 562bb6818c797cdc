"""Whole histories of a drone: code in C and reference take the same decisions for the same reasons."""

import json
import os
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.app_interface import EndReason, LandingState
from onboard.firmware.library import CoreLibrary
from onboard.landing.model import OutputMode
from tests.drawn_examples import examples
from tests.firmware.histories import (
    APPROACHES,
    FORCE,
    LANDING,
    MOTIONS,
    POSE_AGES,
    SETPOINTS,
    WRITES,
    Compared,
    Stretch,
    compare,
)

_MOSTLY = st.sampled_from([True] * 5 + [False])
STRETCHES = st.builds(
    Stretch,
    ms=st.integers(1, 300),
    write=st.none() | st.sampled_from(WRITES),
    approach=st.integers(0, 2) | st.integers(0, len(APPROACHES) - 1),
    motion=st.sampled_from(MOTIONS),
    pose_age=st.just(5) | st.sampled_from(POSE_AGES),
    setpoint=st.just("hover") | st.sampled_from(SETPOINTS),
    flying=_MOSTLY,
    levelling=_MOSTLY.map(lambda mostly: not mostly),
)
DESK = (LANDING[0], Stretch(20, "rehearse", flying=False))
BEGUN = (LANDING[0], LANDING[1], LANDING[2], Stretch(700, "go", motion="plan"))
HISTORIES = st.tuples(
    st.sampled_from([(), LANDING[:1], LANDING[:3], BEGUN, LANDING]),
    st.lists(STRETCHES, min_size=1, max_size=6),
).map(lambda parts: [*parts[0], *parts[1]])

ENDS = {
    "a landing": (
        [
            *LANDING,
            Stretch(300, motion="flip"),
            Stretch(50, "disarm", flying=False),
            Stretch(50, "policy off", flying=False),
        ],
        (LandingState.CUT, EndReason.TRIGGERED),
    ),
    "a flip that takes too long": ([*LANDING, Stretch(600)], (LandingState.CUT, EndReason.TRIGGERED)),
    "missed": (
        [*LANDING[:1], LANDING[2], Stretch(1900, "go", motion="plan"), Stretch(300, motion="climb")],
        (LandingState.BRAKE, EndReason.MISSED_TRIGGER),
    ),
    "missed with a policy": (
        [*LANDING[:2], Stretch(30, "arm", approach=3), Stretch(2500, "go", motion="plan")],
        (LandingState.BRAKE, EndReason.MISSED_TRIGGER),
    ),
    "handed over": (
        [
            *BEGUN,
            Stretch(100, "abort", motion="climb"),
            Stretch(600, motion="fall"),
            Stretch(900, "disarm", motion="stay"),
        ],
        (LandingState.IDLE, EndReason.ABORT),
    ),
    "handed over before it has slowed down": (
        [*BEGUN, Stretch(8, "disarm", motion="fall"), Stretch(8)],
        (LandingState.IDLE, EndReason.DISARMED),
    ),
    "lost in a hold": (
        [
            *BEGUN,
            Stretch(100, "abort", motion="climb"),
            Stretch(300, motion="fall"),
            Stretch(700, motion="estimate lost"),
        ],
        (LandingState.FAULT, EndReason.ABORT),
    ),
    "reset in a blind hold": (
        [*BEGUN, Stretch(700, "abort", motion="fall"), Stretch(700, motion="reset", pose_age=None)],
        (LandingState.FAULT, EndReason.ABORT),
    ),
    "tilt": ([*BEGUN, Stretch(200, motion="tilt")], (LandingState.CUT, EndReason.TILT)),
    "off track": ([*BEGUN, Stretch(50, motion="beside")], (LandingState.BRAKE, EndReason.OFF_TRACK)),
    "no poses": (
        [*BEGUN, Stretch(50, motion="plan", pose_age=152)],
        (LandingState.BRAKE, EndReason.POSE_LOST),
    ),
    "disarmed": ([*BEGUN, Stretch(50, "disarm", motion="plan")], (LandingState.BRAKE, EndReason.DISARMED)),
    "estimate lost": ([*BEGUN, Stretch(9, motion="gyro lost")], (LandingState.BRAKE, EndReason.BAD_ESTIMATE)),
    "not flying": ([*BEGUN, Stretch(9, flying=False)], (LandingState.CUT, EndReason.NOT_FLYING)),
    "rehearsed": (
        [*DESK, *(replace(stretch, flying=False, setpoint="null") for stretch in LANDING[1:])],
        (LandingState.FLIP, EndReason.TRIGGERED),
    ),
    "a rehearsal that ends in a flight": (
        [*DESK, *(replace(s, flying=False) for s in BEGUN[1:]), Stretch(50, flying=True)],
        (LandingState.IDLE, EndReason.NONE),
    ),
    "contact": ([*BEGUN, Stretch(9, motion="at the ceiling")], (LandingState.BRAKE, EndReason.CONTACT)),
}


def check(compared: Compared) -> None:
    assert compared.difference is None or compared.explained, compared.difference
    assert all(force <= FORCE for force in compared.force.values()), compared.force


@pytest.mark.parametrize("name", ENDS)
def test_each_end_of_an_approach(core: CoreLibrary, name: str) -> None:
    history, end = ENDS[name]
    compared = compare(history, seed=1)
    assert end in compared.visited
    check(compared)


def test_they_come_through_every_state_and_reason() -> None:
    ends = [end for _, end in ENDS.values()]
    assert {reason for _, reason in ends} >= set(EndReason) - {EndReason.NONE}


@pytest.mark.further
@settings(max_examples=examples(25))
@given(history=HISTORIES, seed=st.integers(0, 1000))
def test_any_history(core: CoreLibrary, history: list[Stretch], seed: int) -> None:
    check(compare(history, seed))


def random_history(rng: np.random.Generator) -> list[Stretch]:
    """As `HISTORIES`, without hypothesis, which would take most of the time."""
    begun: tuple[Stretch, ...] = ((), LANDING[:1], LANDING[:3], BEGUN, LANDING)[rng.integers(5)]
    return [
        *begun,
        *(
            Stretch(
                ms=int(rng.integers(1, 300)),
                write=None if rng.random() < 0.4 else WRITES[rng.integers(len(WRITES))],
                approach=int(rng.integers(3 if rng.random() < 0.7 else len(APPROACHES))),
                motion=MOTIONS[rng.integers(len(MOTIONS))],
                pose_age=5 if rng.random() < 0.7 else POSE_AGES[rng.integers(len(POSE_AGES))],
                setpoint="hover" if rng.random() < 0.7 else SETPOINTS[rng.integers(len(SETPOINTS))],
                flying=bool(rng.random() < 0.85),
                levelling=bool(rng.random() < 0.1),
            )
            for _ in range(rng.integers(1, 7))
        ),
    ]


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_million_steps_of_random_histories(core: CoreLibrary, capsys: pytest.CaptureFixture[str]) -> None:
    """Every difference is a threshold, and there are few; ``SEED`` gives other histories."""
    rng = np.random.default_rng(int(os.environ.get("SEED", "1")))
    steps, count, visited, force = 0, Counter[str](), Counter[str](), dict.fromkeys(OutputMode, 0.0)
    while steps < 1_000_000:
        history = random_history(rng)
        steps += sum(stretch.ms for stretch in history)
        compared = compare(history, int(rng.integers(1 << 30)))
        check(compared)
        count["same" if compared.difference is None else "threshold"] += 1
        visited.update(f"{state.name} {reason.name}" for state, reason in compared.visited)
        force = {mode: max(most, compared.force.get(mode, 0.0)) for mode, most in force.items()}
    document = {"histories": count, "visited": visited, "force_n": {m.name: f for m, f in force.items()}}
    with capsys.disabled():
        sys.stdout.write(json.dumps(document) + "\n")
    assert count["threshold"] <= 0.05 * count.total()
