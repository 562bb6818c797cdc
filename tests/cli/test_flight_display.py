"""What the operator reads of a flight: each phase and each alert once."""

from dataclasses import replace

import pytest

from perchhw.cli.output import FlightDisplay
from perchhw.supervisor import FlightState, Phase

UNSEEN = "NOT SEEN: mocap has no pose"


def in_phase(phase: Phase, alert: str | None = None) -> FlightState:
    return replace(FlightState(phase=phase, entered_at=0.0), alert=alert)


FLIGHT = [
    in_phase(Phase.FLIPPING),
    in_phase(Phase.SETTLING),
    in_phase(Phase.SETTLING, UNSEEN),
    in_phase(Phase.DISARMING, UNSEEN),
    in_phase(Phase.DONE, UNSEEN),
]


def said(display: FlightDisplay, capsys: pytest.CaptureFixture[str], states: list[FlightState]) -> list[str]:
    for state in states:
        display(state)
    return [line.strip("\a ") for line in capsys.readouterr().err.splitlines()]


def test_phases_and_alerts_are_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert said(FlightDisplay(), capsys, FLIGHT) == ["flipping", "settling", UNSEEN, "disarming", "done"]


def test_alerts_alone_are_said_anew_in_each_flight(capsys: pytest.CaptureFixture[str]) -> None:
    assert said(FlightDisplay(phases=False), capsys, FLIGHT * 2) == [UNSEEN, UNSEEN]


def test_another_alert_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    states = [in_phase(Phase.SETTLING, text) for text in ("A: 1", "B: 2", None, "B: 2")]
    assert said(FlightDisplay(phases=False), capsys, states) == ["A: 1", "B: 2", "B: 2"]
