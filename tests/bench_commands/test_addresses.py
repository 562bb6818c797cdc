"""Scales and supplies by their URIs at the command line: each measures the truth, or nothing turns."""

import json
import os
import pty
import re
import subprocess
import sys
import termios
import tty
from pathlib import Path

import pytest

from calibration.bench.instruments.motor_stand import UNLOCK_PHRASE
from calibration.bench.procedures.assistant import Assistant
from calibration.bench.procedures.calibration import load_calibration
from calibration.bench.procedures.compare import compare_with_vehicle
from calibration.bench.procedures.motors import HAND_PHRASE
from onboard.vehicle import load_vehicle
from perchhw.lab_process import SimulatedLab
from tests.bench_commands.conftest import Bench, Refused, command, patient_ports, run
from tests.bench_commands.test_wizards import spin_record, steps
from tests.patience import patient_uri

FEW = ("--levels", "8", "--voltages", "3.9")


def thrust(served: SimulatedLab, out: Path, scale: str, supply: str, *further: str) -> list[str]:
    """The thrust wizard with these instruments."""
    line = command("thrust", served, out)
    line[line.index("--scale") + 1] = scale
    line[line.index("--supply") + 1] = supply
    return [*line, *FEW, *further]


def assert_the_truth_is_found(folder: Path, true_file: Path, within_gf: float) -> None:
    rows = compare_with_vehicle(load_vehicle(true_file), load_calibration(folder))
    assert len(rows) >= 4
    for row in rows:
        assert abs(row.now.value - row.before.value) < within_gf * 9.80665e-3 + row.now.u95, row


@pytest.mark.soak
def test_a_balance_and_a_korad_supply_measure_thrust(bench: Bench, tmp_path: Path, true_file: Path) -> None:
    served = bench(pace=4)
    ports = patient_ports(served)
    said = run(thrust(served, tmp_path, ports["balance"], ports["korad"]))
    assert_the_truth_is_found(tmp_path, true_file, 0.2)
    assert said["rejected"] == []
    assert steps(tmp_path)["scale"]["result"]["counts_per_kg"] == pytest.approx(1.0, abs=2e-3)
    spins = spin_record(ports["hands"])["spins"]
    assert spins
    assert all(spin["stopped"] is not None for spin in spins)


@pytest.mark.soak
def test_the_ports_of_the_ready_line_mean_a_load_cell_and_a_scpi_supply(bench: Bench, tmp_path: Path) -> None:
    served = bench()
    ports = patient_ports(served)
    out = tmp_path / "run"
    line = thrust(served, out, f"loadcell://{ports['scale']}", f"scpi://{ports['supply']}")
    run(line)
    done = steps(out)
    again = [*line]
    again[again.index("--scale") + 1], again[again.index("--supply") + 1] = ports["scale"], ports["supply"]
    run(again)
    assert steps(out) == done
    again[again.index("--scale") + 1] = ports["balance"]
    forget_sweep(out)
    assert "same --scale" in run(again, expected=2)["error"]


def forget_sweep(folder: Path) -> None:
    """Forget the last step of a run."""
    state = json.loads((folder / "state.json").read_text())
    state["steps"].popitem()
    (folder / "state.json").write_text(json.dumps(state))


@pytest.mark.parametrize(
    ("scale", "supply", "words"),
    [
        ("scale:///dev/x", "scpi:///dev/x", "is no scale: write loadcell://"),
        ("manual://", "psu:///dev/x", "is no supply: write scpi://"),
        ("loadcell:///dev/none", "scpi:///dev/none", "there is no port /dev/none"),
    ],
)
def test_what_is_no_instrument_is_told_before_anything_turns(
    still_bench: SimulatedLab, refused: Refused, tmp_path: Path, scale: str, supply: str, words: str
) -> None:
    assert words in refused(thrust(still_bench, tmp_path, scale, supply), expected=2)
    assert spin_record(still_bench.ready["bench"]["hands"])["spins"] == []


@pytest.mark.parametrize(
    ("kind", "further", "asked_for"),
    [
        ("thrust", (), "--no-remote-cut"),
        ("thrust", ("--no-remote-cut",), f"--confirm '{HAND_PHRASE}'"),
        ("tachometer", (), "--no-remote-cut"),
    ],
)
def test_a_supply_set_by_hand_is_no_remote_cut(
    still_bench: SimulatedLab,
    refused: Refused,
    tmp_path: Path,
    kind: str,
    further: tuple[str, ...],
    asked_for: str,
) -> None:
    line = command(kind, still_bench, tmp_path, *further)
    line[line.index("--supply") + 1] = "manual://"
    assert asked_for in refused(line, expected=3)
    assert spin_record(still_bench.ready["bench"]["hands"])["spins"] == []


class Person:
    """Sits at a terminal, does what it says, and types what they see; works the bench by its hands."""

    def __init__(self, hands: Assistant) -> None:
        self._hands = hands

    def answer(self, text: str) -> str | None:
        """What to type after `text`, the output since the last answer; None to read on."""
        text = " ".join(text.split())  # lines are wrapped
        if "Read the scale now" in text and "what the scale showed" not in text:
            self._do(do="read_scale")
            return ""
        for prompt, typed in (
            (r"Type '(.*)':", lambda match: match.group(1)),
            (r"(what the scale showed)[^:]*:", lambda _: self._ask("scale_reading", 1e3, "g")),
            (r"(multimeter|supply shows)[^:]*:", lambda _: self._ask("supply_voltage", 1.0, "V")),
            (r"\[Enter\] done", lambda _: self._work(text)),
        ):
            match = re.search(prompt, text)
            if match:
                return typed(match) + "\n"
        return None

    def _work(self, text: str) -> str:
        if weight := re.search(r"Put (\d+) g", text):
            self._do(do="put_weight", mass=1e-3 * int(weight.group(1)))
        elif "Empty the scale" in text or "weight off" in text:
            self._do(do="remove_weight")
        elif "Mount the drone" in text:
            self._do(do="mount_on_scale")
        if switch := re.search(r"Switch the supply (on|OFF)", text):
            voltage = re.search(r"Set the supply to ([0-9.]+) V", text)
            if voltage:
                self._do(do="set_supply", voltage=float(voltage.group(1)), current_limit=8.0)
            self._do(do="switch_supply", on=switch.group(1) == "on")
        return ""

    def _do(self, **request: object) -> None:
        self._hands.request(request)

    def _ask(self, name: str, factor: float, unit: str) -> str:
        return f"{factor * self._hands.request({'ask': name})['value']:.2f} {unit}"


def at_a_terminal(line: list[str], person: Person) -> tuple[int, str]:
    """Run a command whose terminal the person has; exit code, and all that it showed."""
    ours, theirs = pty.openpty()
    tty.setraw(ours)
    attributes = termios.tcgetattr(theirs)
    attributes[3] &= ~termios.ECHO
    termios.tcsetattr(theirs, termios.TCSANOW, attributes)
    plain = {**os.environ, "TERM": "dumb", "COLUMNS": "400"}
    shown = since = ""
    with subprocess.Popen(line, stdin=theirs, stdout=subprocess.DEVNULL, stderr=theirs, env=plain) as run:
        os.close(theirs)
        try:
            while data := _read(ours):
                shown += data
                since += data
                while (typed := person.answer(since)) is not None:
                    os.write(ours, typed.encode())
                    since = ""
        except BaseException:
            run.kill()
            raise
        finally:
            os.close(ours)
    return run.returncode, " ".join(shown.split())


def _read(terminal: int) -> str:
    try:
        return os.read(terminal, 65536).decode("utf-8", "replace")
    except OSError:  # the other end is closed
        return ""


@pytest.mark.soak
def test_a_person_sets_the_supply_and_types_what_the_scale_shows(
    bench: Bench, tmp_path: Path, true_file: Path
) -> None:
    served = bench(pace=3)  # somebody must look while the motors turn
    line = [sys.executable, "-m", "perchhw", "calibrate", "thrust", *FEW, "--out", str(tmp_path)]
    line += ["--drone", patient_uri(served.drones[0]), "--scale", "manual://", "--supply", "manual://"]
    with Assistant(served.ready["bench"]["hands"], lambda text: None) as hands:
        code, shown = at_a_terminal([*line, "--no-remote-cut"], Person(hands))
    assert code == 0, shown
    assert HAND_PHRASE in shown
    assert UNLOCK_PHRASE in shown
    assert "Switch the supply OFF" in shown
    assert_the_truth_is_found(tmp_path, true_file, 0.3)
