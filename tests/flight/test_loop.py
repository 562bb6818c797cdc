"""An exception at every call of the loop, one at a time: the drone lands or is stopped, and it is told."""

import threading
from pathlib import Path
from typing import Any

import pytest

import perchhw.flight.loop as loop_module
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder
from perchhw.supervisor import Phase
from tests.flight.stepped_flight import Injected, Injection, Stepped, fly
from tests.flight.stepped_landing import APPROACH, landing_attempt
from tests.tiers import some

PLACES = (
    "clock()",
    "link.lost",
    "bridge.set_in_flight",
    "telemetry.observe",
    "commands.retire",
    "commands.submit",
    "record.event",
    "record.write",
    "record.look_for_loss",
    "lateness.note",
    "recorder.event",
    "recorder.write",
    "interrupts.count",
    "kicker.beat",
    "kicker.problem",
    "events.get",
)
DISPLAYS = ("on_phase()", "on_look()")
STOP_PLACES = ("link.stop_path", "stop_path.trigger", "stop_path.report")
PATIENCE_S = 60.0
SOFT = 1.5
"""m/s; a drone whose motors stop at the height of the hover hits the floor with 3 m/s."""


def at_rest(stepped: Stepped) -> bool:
    """On the floor, with motors that do not turn."""
    return stepped.flight.position[2] < 0.15 and not stepped.flight.firmware.ratios.any()


def test_the_loop_calls_nothing_else(tmp_path: Path) -> None:
    """Whoever lets the loop call something new adds it to the places above."""
    injection = Injection()
    stepped = fly(tmp_path / "run", injection)
    assert at_rest(stepped)
    assert stepped.fastest_fall < SOFT
    assert stepped.state.phase is Phase.DONE
    used = injection.touched - {"recorder.close", "clock.event"}
    assert used == {*PLACES, *DISPLAYS}


PHASES = (
    Phase.TAKING_OFF,
    Phase.LANDING,
    Phase.MOVING_TO_START,
    Phase.CHECKING,
    Phase.ARMING,
    Phase.DISARMING,
)


@pytest.mark.parametrize("phase", some(PHASES, len(PHASES)))
@pytest.mark.parametrize("place", PLACES)
def test_one_exception_in_the_air_ends_in_a_soft_landing(
    place: str, phase: Phase, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    injection = Injection(place, phase)
    stepped = fly(tmp_path / "run", injection)
    assert at_rest(stepped)
    assert stepped.state.phase is Phase.DONE
    assert stepped.state.aborted_by is not None
    logged = Injected in [record.exc_info[0] for record in caplog.records if record.exc_info]
    assert logged == bool(injection.thrown), "some are not called in every phase"
    if place != "commands.submit":  # a landing that cannot be ordered is a stop
        assert stepped.fastest_fall < SOFT
        assert not stepped.flight.info.is_locked


@pytest.mark.further
@pytest.mark.parametrize("phase", [Phase.APPROACHING, Phase.FLIPPING, Phase.SETTLING])
@pytest.mark.parametrize("place", PLACES)
def test_one_exception_on_the_way_to_the_ceiling_costs_no_drone(
    place: str, phase: Phase, tmp_path: Path
) -> None:
    """Before the trigger the drone brakes and lands; from it on the flip goes on, and it hangs."""
    injection = Injection(place, phase)
    stepped = fly(tmp_path / "run", injection, flown=landing_attempt)
    assert stepped.state.phase is Phase.DONE
    told = stepped.state.aborted_by or stepped.state.record_lost
    assert bool(told) == bool(injection.thrown), "some are not called in every phase"
    if not injection.thrown:
        return
    assert not stepped.flight.firmware.ratios.any()
    assert not stepped.flight.info.is_locked
    assert stepped.state.triggered == (phase is not Phase.APPROACHING)
    if stepped.state.triggered:
        assert stepped.flight.position[2] > APPROACH.ceiling_z - 0.15
    else:
        assert stepped.flight.position[2] < 0.15
        assert stepped.fastest_fall < SOFT


@pytest.mark.parametrize("place", some(PLACES, 3))
def test_a_part_that_fails_for_ever_ends_on_the_floor(place: str, tmp_path: Path) -> None:
    injection = Injection(place, Phase.TAKING_OFF, always=True)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown
    assert at_rest(stepped)
    assert stepped.state.phase is Phase.DONE
    assert stepped.state.aborted_by is not None


def test_a_disk_that_stands_still_in_the_air_holds_up_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drone lands, though nothing that was recorded since has been written."""
    monkeypatch.setattr("perchhw.flight.recording.STUCK_S", 0.0)
    disk_goes_on, write = threading.Event(), RunRecorder.write

    def write_to_a_slow_disk(self: RunRecorder, topic: str, t: float, values: dict[str, Any]) -> None:
        if values.get("state") == Phase.TAKING_OFF.value:
            disk_goes_on.wait(PATIENCE_S)
        write(self, topic, t, values)

    monkeypatch.setattr(RunRecorder, "write", write_to_a_slow_disk)
    stepped = fly(tmp_path / "run", Injection(), FlightRecorder)
    assert not disk_goes_on.is_set()
    disk_goes_on.set()
    assert at_rest(stepped)
    assert stepped.fastest_fall < SOFT
    assert stepped.late_s < 0.03
    assert str(stepped.state.aborted_by).startswith("record_lost: the disk has taken nothing for")


@pytest.mark.parametrize("error", [Injected, pytest.param(SystemExit, marks=pytest.mark.further)])
@pytest.mark.parametrize("place", DISPLAYS)
def test_a_display_that_fails_ends_no_flight(place: str, error: type[BaseException], tmp_path: Path) -> None:
    """A console whose pipe has closed raises ``SystemExit``."""
    injection = Injection(place, Phase.TAKING_OFF, always=True, error=error)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown == 1
    assert at_rest(stepped)
    assert stepped.late_s < 0.03
    assert stepped.state.phase is Phase.DONE
    assert "no FlyCourse" in str(stepped.state.aborted_by), "as without a display"


def test_a_library_that_gives_up_the_process_does_not_give_up_the_drone(tmp_path: Path) -> None:
    injection = Injection("telemetry.observe", Phase.MOVING_TO_START, error=SystemExit)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown
    assert at_rest(stepped)
    assert stepped.fastest_fall < SOFT
    assert not stepped.flight.info.is_locked
    assert "SystemExit" in str(stepped.state.aborted_by)


@pytest.mark.parametrize(("seconds", "noticed"), [(0.25, False), (0.4, True), (0.9, True)])
@pytest.mark.parametrize(
    "phase", [Phase.TAKING_OFF, pytest.param(Phase.MOVING_TO_START, marks=pytest.mark.further)]
)
def test_a_program_that_stood_still_in_the_air_lands_and_says_why(
    phase: Phase, seconds: float, noticed: bool, tmp_path: Path
) -> None:
    """Meanwhile nobody kicked the drone's watchdog. What was seen before it says nothing of now."""
    injection = Injection("telemetry.observe", phase, stands_still_s=seconds)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown
    assert at_rest(stepped)
    assert stepped.fastest_fall < SOFT
    assert stepped.late_s == pytest.approx(seconds, abs=0.03)
    told = f"host_stood_still: {seconds:g}" if noticed else "FlyCourse failed: "
    assert str(stepped.state.aborted_by).startswith(told)


@pytest.mark.parametrize(
    ("place", "always"), [*((place, False) for place in STOP_PLACES), ("stop_path.report", True)]
)
def test_a_stop_whose_answer_cannot_be_read_still_ends(
    place: str, always: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The landing cannot be ordered, so the supervisor stops; then the way to the stop fails."""

    def no_landing(self: Any, order: Any) -> None:
        raise Injected("submit")

    injection = Injection(place, Phase.STOPPING, always)
    from tests.flight.stepped_flight import DirectRunner

    carry_out = DirectRunner.submit

    def submit(self: Any, order: Any) -> None:
        if type(order.command).__name__ == "Land":
            no_landing(self, order)
        carry_out(self, order)

    monkeypatch.setattr(DirectRunner, "submit", submit)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown
    assert stepped.state.phase is Phase.DONE
    if place == "stop_path.report":
        assert at_rest(stepped)
        assert stepped.flight.info.is_locked
    if always or place != "stop_path.report":
        assert stepped.state.alert is not None, "the operator must know that it may still fly"


@pytest.mark.parametrize("always", [False, True])
def test_a_supervisor_that_fails_lands_or_is_stopped(
    always: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    injection = Injection("step", Phase.MOVING_TO_START, always=always)
    step = loop_module.step

    def failing(*arguments: Any) -> Any:
        injection.touch("step")
        return step(*arguments)

    monkeypatch.setattr(loop_module, "step", failing)
    stepped = fly(tmp_path / "run", injection)
    assert injection.thrown
    assert at_rest(stepped)
    assert stepped.state.phase is Phase.DONE
    assert "internal_error" in str(stepped.state.aborted_by)
    assert stepped.flight.info.is_locked is always
