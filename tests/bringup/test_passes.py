"""What a drone has passed today, and what is refused for it."""

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from onboard.errors import SafetyStop
from perchhw.bringup.climb import climb
from perchhw.bringup.passes import STEPS, Passes, PassesNotKept, StepRefused
from perchhw.doctor.check_result import CheckResult, CheckVerdict, judged

DAY = date(2026, 11, 23)
KEY = "radio://0/80/2M/E7E7E7E7E7 00000007 2026-11-23"
"""Under which the passes of the drone here are kept."""
FINE = judged("thing", True, "1", "1", "", "")
BAD = judged("thing", False, "2", "1", "why", "remedy")
UNKNOWN = CheckResult("thing", CheckVerdict.UNKNOWN, "", "1", "why", "remedy")


def passes(
    tmp_path: Path, drone: str = "radio://0/80/2M/E7E7E7E7E7", crc: int = 7, day: date = DAY
) -> Passes:
    return Passes(drone, crc, day, tmp_path / "state" / "bringup.json")


def run(kept: Passes, step: str, finding: CheckResult = FINE, look: CheckResult = FINE) -> None:
    climb(step, kept, lambda: (look,), lambda: (finding,))


def test_every_step_needs_all_below_it(tmp_path: Path) -> None:
    kept = passes(tmp_path)
    for number, step in enumerate(STEPS):
        for above in STEPS[number + 1 :]:
            with pytest.raises(StepRefused, match=f"{above} is refused: {step} has not passed"):
                run(kept, above)
        run(kept, step)
        assert kept.passed == STEPS[: number + 1]


def test_passes_hold_for_one_drone_one_vehicle_and_one_day(tmp_path: Path) -> None:
    run(passes(tmp_path), "motors")
    assert passes(tmp_path).passed == ("motors",)
    assert passes(tmp_path, drone="radio://0/90/2M/E7E7E7E7E7").passed == ()
    assert passes(tmp_path, crc=8).passed == ()
    assert passes(tmp_path, day=date(2026, 11, 24)).passed == ()
    assert replace(passes(tmp_path), own_law=True).passed == (), "the PID's hover is not ours"
    run(passes(tmp_path, crc=8), "motors")
    assert passes(tmp_path).passed == ("motors",)


@pytest.mark.parametrize("finding", [BAD, UNKNOWN])
def test_a_step_that_fails_takes_back_what_stood_on_it(finding: CheckResult, tmp_path: Path) -> None:
    kept = passes(tmp_path)
    for step in ("motors", "tilt", "hover"):
        run(kept, step)
    run(kept, "tilt", finding)
    assert kept.passed == ("motors",)


def test_nothing_turns_or_flies_that_could_not_be_noted(tmp_path: Path) -> None:
    (tmp_path / "state").touch()  # where the folder should be
    flown: list[str] = []

    def fly() -> tuple[CheckResult, ...]:
        flown.append("motors")
        return (FINE,)

    with pytest.raises(PassesNotKept, match=r"bringup\.json: .*XDG_STATE_HOME"):
        climb("motors", passes(tmp_path), lambda: (FINE,), fly)
    assert flown == []


def test_a_step_that_raises_has_not_passed(tmp_path: Path) -> None:
    kept = passes(tmp_path)
    run(kept, "motors")

    def stumble() -> tuple[CheckResult, ...]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        climb("motors", kept, lambda: (FINE,), stumble)
    assert kept.passed == ()


def test_what_the_doctor_misses_refuses_the_step_before_it_runs(tmp_path: Path) -> None:
    kept = passes(tmp_path)
    with pytest.raises(SafetyStop, match="motors is refused: thing: 2"):
        climb("motors", kept, lambda: (BAD,), lambda: pytest.fail("it ran"))


@pytest.mark.parametrize(
    "damaged",
    ["{half", "[]", f'{{"{KEY}": null}}', f'{{"{KEY}": "motors tilt"}}', f'{{"{KEY}": {{"motors": true}}}}'],
)
def test_a_file_that_is_damaged_has_no_passes(damaged: str, tmp_path: Path) -> None:
    kept = passes(tmp_path)
    kept.file.parent.mkdir()
    kept.file.write_text(damaged, encoding="utf-8")
    assert not kept.passed
    run(kept, "motors")
    assert kept.passed == ("motors",)
