"""The wizards as an operator uses them: command line, real protocols, a simulated bench, the truth hidden."""

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from calibration.bench.procedures.assistant import Assistant
from calibration.bench.procedures.calibration import load_calibration
from calibration.bench.procedures.compare import compare_with_vehicle
from onboard.vehicle import load_vehicle
from perchhw.lab_process import SimulatedLab
from perchhw.walkthrough.bench.story import BELIEVED
from tests.bench_commands.conftest import Bench, Refused, Said, command, run, run_here, serve
from tests.bench_commands.until import until
from tests.patience import PATIENCE_S


def spin_record(address: str) -> dict[str, Any]:
    with Assistant(address, lambda text: None) as hands:
        record: dict[str, Any] = hands.request({"ask": "spin_record"})["value"]
    return record


@dataclass(frozen=True)
class InertiaRun:
    """A run that was killed in its second swing, taken up again, and then fitted once more."""

    folder: Path
    kept: dict[str, Any]
    said: dict[str, Any]
    fitted_again: dict[str, Any]


@pytest.fixture(scope="module")
def inertia_run(true_file: Path, tmp_path_factory: pytest.TempPathFactory) -> InertiaRun:
    folder = tmp_path_factory.mktemp("inertia")
    with serve(true_file) as bench:
        line = command("bifilar", bench, folder, "--axes", "z", "--trials", "4", "--cycles", "10")
        line += ["--operator", "Ada"]
        with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as wizard:
            until(lambda: "trial-z-1" in steps(folder), PATIENCE_S)
            wizard.kill()
        kept = steps(folder)
        return InertiaRun(folder, kept, run_here(line), run_here(line))


def test_inertia_is_found_within_its_interval(inertia_run: InertiaRun, true_file: Path) -> None:
    said, true, believed = inertia_run.said, load_vehicle(true_file), load_vehicle(BELIEVED)
    found = said["vehicle"]["quantities"]["body.inertia_zz"]
    assert abs(found["value"] - true.body.inertia_zz.value) < found["u95"]
    assert found["u95"] < 0.01 * found["value"]
    assert abs(believed.body.inertia_zz.value - found["value"]) > 5.0 * found["u95"]
    assert said["rejected"] == []
    report = Path(said["report"]).read_text(encoding="utf-8")
    assert "string distance" in report
    assert "Ada" in report
    assert report.count("<svg") >= 3


def test_a_killed_wizard_goes_on_where_it_was(inertia_run: InertiaRun) -> None:
    kept, after = inertia_run.kept, steps(inertia_run.folder)
    assert set(kept) >= {"weigh", "hang-z", "rest-z", "trial-z-1"}
    assert {key: after[key] for key in kept} == kept
    assert len(load_calibration(inertia_run.folder).details["z"]["trials_s"]) == 4


def test_the_same_recordings_give_the_same_result(inertia_run: InertiaRun) -> None:
    assert inertia_run.fitted_again["vehicle"] == inertia_run.said["vehicle"]
    assert load_calibration(inertia_run.folder).parent == inertia_run.said["id"]


def test_a_calibration_is_applied_and_undone(
    inertia_run: InertiaRun, said: Said, tmp_path: Path, true_file: Path
) -> None:
    file = tmp_path / "lab.toml"
    calibrate = [sys.executable, "-m", "perchhw", "--json", "calibrate"]
    apply = [*calibrate, "apply", str(inertia_run.folder), "--vehicle", BELIEVED, "--out", str(file), "--yes"]
    assert [row["key"] for row in said(apply)["changes"]] == ["body.mass", "body.inertia_zz"]
    calibrated = load_vehicle(file).body.inertia_zz
    assert calibrated.value == pytest.approx(load_vehicle(true_file).body.inertia_zz.value, rel=0.01)
    before = file.read_text()
    said(apply)
    said([*calibrate, "undo", str(file)])
    assert file.read_text() == before
    compared = said([*calibrate, "compare", str(inertia_run.folder), "--vehicle", BELIEVED], expected=1)
    assert {row["key"]: row["contradicts"] for row in compared["rows"]}["body.inertia_zz"]


def test_motors_are_measured_within_their_intervals(bench: Bench, tmp_path: Path, true_file: Path) -> None:
    served = bench(pace=2)
    said = run_here(command("tachometer", served, tmp_path, "--motors", "1", "--repeats", "1"))
    rows = {row.key: row for row in compare_with_vehicle(load_vehicle(true_file), load_calibration(tmp_path))}
    assert {key: row.normalised for key, row in rows.items() if key.startswith("effects")} == {
        f"effects.motor_speed_law.{name}": pytest.approx(0.5, abs=0.5)
        for name in ("a_up", "b_up", "a_down", "b_down")
    }
    assert said["rejected"] == []
    assert spin_record(served.ready["bench"]["hands"])["incidents"] == []


@pytest.mark.soak  # the same wizard measures with typed values in test_addresses
def test_thrust_is_measured_within_its_band(bench: Bench, tmp_path: Path, true_file: Path) -> None:
    run(command("thrust", bench(), tmp_path, "--levels", "8", "--voltages", "3.9"))
    rows = compare_with_vehicle(load_vehicle(true_file), load_calibration(tmp_path))
    assert len(rows) >= 4
    for row in rows:
        assert abs(row.now.value - row.before.value) < 0.1 * 9.80665e-3 + row.now.u95, row
    wrong = compare_with_vehicle(load_vehicle(BELIEVED), load_calibration(tmp_path))
    assert all(row.contradicts for row in wrong)


def test_motors_stop_at_ctrl_c(bench: Bench, tmp_path: Path) -> None:
    served, run_folder, said = bench(pace=1), tmp_path / "run", tmp_path / "said"
    line = command("tachometer", served, run_folder, "--motors", "1", "--repeats", "1")
    with (
        said.open("w") as errors,
        subprocess.Popen(line, stdout=subprocess.PIPE, stderr=errors, text=True) as wizard,
    ):
        until(lambda: "align-1" in steps(run_folder) or wizard.poll() is not None, PATIENCE_S)
        until(lambda: turning(served.ready["bench"]["hands"]) or wizard.poll() is not None, PATIENCE_S)
        assert wizard.poll() is None, said.read_text()
        wizard.send_signal(signal.SIGINT)
        output, _ = wizard.communicate(timeout=PATIENCE_S)
    assert wizard.returncode == 130
    assert json.loads(output)["exit_code"] == 130
    until(lambda: not turning(served.ready["bench"]["hands"]), PATIENCE_S)
    last = spin_record(served.ready["bench"]["hands"])["spins"][-1]
    # Half a second; the rest is for a machine that is eight times slower.
    assert last["stopped"] - last["last_command"] < 4.0


def test_nothing_turns_without_the_operators_word(
    still_bench: SimulatedLab, refused: Refused, tmp_path: Path
) -> None:
    line = command("tachometer", still_bench, tmp_path)
    cut = line.index("--confirm")
    assert "props guarded" in refused(line[:cut] + line[cut + 2 :], expected=3)
    assert spin_record(still_bench.ready["bench"]["hands"])["spins"] == []


def steps(folder: Path) -> dict[str, Any]:
    path = folder / "state.json"
    return json.loads(path.read_text())["steps"] if path.is_file() else {}


def turning(address: str) -> bool:
    spins = spin_record(address)["spins"]
    return bool(spins) and spins[-1]["stopped"] is None
