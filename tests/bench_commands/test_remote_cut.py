"""A wizard that is killed or hangs while motors turn: the supply is off soon after, by the bench's record."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.instruments.supply_keeper import HANG_S
from calibration.bench.procedures.motors import HAND_PHRASE
from onboard.app_interface import MOTOR_STOP_MS
from onboard.link.uri import SILENCE_LIMIT
from perchhw.lab_process import SimulatedLab
from tests.bench_commands.conftest import Bench, Refused, command
from tests.bench_commands.test_wizards import spin_record, turning
from tests.bench_commands.until import until
from tests.patience import PATIENCE_S, patient_uri

CUT_S = 4.0
"""What the cut itself may take: the keeper wakes, the supply hears, the drone loses its power. That is half a
second; the rest is for a machine that is eight times slower."""


@contextmanager
def turning_wizard(served: SimulatedLab, folder: Path, *changes: str) -> Iterator[subprocess.Popen[bytes]]:
    """A tachometer wizard whose motor turns; killed at the end."""
    line = [*command("tachometer", served, folder, "--motors", "1", "--repeats", "1"), *changes]
    if "--no-remote-cut" in changes:
        at = line.index("--supply")
        del line[at : at + 2]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as wizard:
        try:
            until(lambda: turning(served.ready["bench"]["hands"]), PATIENCE_S)
            yield wizard
        finally:
            wizard.kill()


PATIENT = 3.0
"""The address of the drone makes the keeper so many times as patient: a busy machine also stops a wizard."""


@pytest.mark.parametrize(
    ("end", "within_s"),
    [
        pytest.param(signal.SIGKILL, CUT_S, marks=pytest.mark.further),
        (signal.SIGSTOP, PATIENT * HANG_S + CUT_S),
    ],
)
def test_motors_lose_their_power_when_the_wizard_dies_or_hangs(
    bench: Bench, tmp_path: Path, end: signal.Signals, within_s: float
) -> None:
    served = bench(pace=1)
    hands = served.ready["bench"]["hands"]
    drone = patient_uri(served.drones[0], PATIENT * SILENCE_LIMIT)
    with turning_wizard(served, tmp_path, "--drone", drone) as wizard:
        before = spin_record(hands)["now"]
        wizard.send_signal(end)
        until(lambda: not turning(hands), PATIENCE_S)
    last = spin_record(hands)["spins"][-1]
    assert last["stopped"] - before < within_s, f"{last['stopped'] - before:.3f} s"


@pytest.mark.further
def test_without_a_supply_they_run_on_as_the_operator_was_told(bench: Bench, tmp_path: Path) -> None:
    served = bench(pace=1)
    hands = served.ready["bench"]["hands"]
    with turning_wizard(served, tmp_path, "--no-remote-cut", "--confirm", HAND_PHRASE) as wizard:
        wizard.kill()
        wizard.wait()
        begin = spin_record(hands)["spins"][-1]["longest_silence"]
        until(lambda: spin_record(hands)["spins"][-1]["longest_silence"] > begin + 3.0, PATIENCE_S)
        assert turning(hands)


@pytest.mark.further
@pytest.mark.parametrize("end", [signal.SIGHUP, signal.SIGTSTP], ids=["terminal closed", "Ctrl-Z"])
def test_without_a_supply_a_terminal_that_closes_or_suspends_stops_the_motors(
    bench: Bench, tmp_path: Path, end: signal.Signals
) -> None:
    if signal.getsignal(end) is signal.SIG_IGN:
        pytest.skip("these tests were started with nohup, and so is the wizard")
    served = bench(pace=1)
    with turning_wizard(served, tmp_path, "--no-remote-cut", "--confirm", HAND_PHRASE) as wizard:
        wizard.send_signal(end)
        assert wizard.wait(PATIENCE_S) == 130
    assert not turning(served.ready["bench"]["hands"])


@pytest.mark.soak  # the drone's patience is a quarter of a second: a very busy machine stops the wizard first
def test_our_app_on_the_drone_stops_the_motors_of_a_host_that_died(bench: Bench, tmp_path: Path) -> None:
    served = bench(pace=1)
    hands = served.ready["bench"]["hands"]
    changes = ("--no-remote-cut", "--confirm", HAND_PHRASE, "--drone", served.drones[0])
    with turning_wizard(served, tmp_path, *changes) as wizard:
        before = spin_record(hands)["now"]
        wizard.kill()
        until(lambda: not turning(hands), PATIENCE_S)
    last = spin_record(hands)["spins"][-1]
    assert last["stopped"] - before < 1e-3 * MOTOR_STOP_MS + 0.2


@pytest.mark.parametrize(
    ("further", "asked_for"),
    [
        (("--yes",), "--no-remote-cut"),
        (("--yes", "--confirm", HAND_PHRASE), "--no-remote-cut"),
        (("--yes", "--no-remote-cut"), f"--confirm '{HAND_PHRASE}'"),
    ],
)
def test_a_battery_needs_the_flag_and_the_operators_word(
    still_bench: SimulatedLab, refused: Refused, tmp_path: Path, further: tuple[str, ...], asked_for: str
) -> None:
    line = command("tachometer", still_bench, tmp_path)
    at = line.index("--supply")
    assert asked_for in refused([*line[:at], *line[at + 2 :], *further], expected=3)
    assert UNLOCK_PHRASE in line
    assert spin_record(still_bench.ready["bench"]["hands"])["spins"] == []
