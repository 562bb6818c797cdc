"""Results: read back as written, noticed when changed, applied as a diff, undone, compared."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.bench.procedures.apply import NothingToUndo, changed_vehicle, undo, write_applied
from calibration.bench.procedures.calibration import (
    Calibration,
    ResultFileError,
    VehicleChange,
    load_calibration,
    write_calibration,
)
from calibration.bench.procedures.compare import compare_calibrations, compare_with_vehicle
from calibration.bench.procedures.report import write_report
from calibration.measurement import Contribution, Estimate, Finding, Severity
from onboard.json_file import as_json
from onboard.vehicle import load_vehicle, vehicle_to_toml

VEHICLE = "crazyflie21-upgraded"
INERTIA = Estimate(2.9e-5, "kg m2", 1e-7, 12.0)


def calibration(inertia: Estimate = INERTIA, findings: tuple[Finding, ...] = ()) -> Calibration:
    cubic = {
        "c0": Estimate(-0.01, "N", 1e-4),
        "c1": Estimate(0.05, "N/V", 1e-4),
        "c2": Estimate(-0.02, "N/V2", 1e-4),
        "c3": Estimate(0.006, "N/V3", 1e-4),
    }
    law = {
        "a_up": Estimate(0.0, "1/s", 0.1),
        "b_up": Estimate(4.2e-3, "1/rad", 1e-4),
        "a_down": Estimate(0.5, "1/s", 0.1),
        "b_down": Estimate(1.8e-3, "1/rad", 1e-4),
    }
    return Calibration(
        kind="bifilar",
        change=VehicleChange(
            quantities={"body.inertia_xx": inertia, "motors.time_constant_up": Estimate(0.06, "s", 0.002)},
            thrust_map=("firmware_cubic", cubic),
            effects={"motor_speed_law": law},
        ),
        budgets={"body.inertia_xx": [Contribution("string distance", 0.002, advice="use a jig")]},
        findings=findings,
        details={"method": "pendulum law"},
        inputs={"mass": Estimate(0.0381, "kg", 1e-5)},
        provenance={"drone": "udp://127.0.0.1:1", "operator": "A. <b>Person</b>"},
        raw=[{"file": "raw/x-1.csv.gz", "sha256": "00"}],
        made="2026-11-21T12:00:00+00:00",
        curve={1.5: Estimate(0.02, "N", 1e-3), 2.0: Estimate(0.05, "N", 1e-3)},
    )


def test_a_result_is_read_back_and_names_its_parent(tmp_path: Path) -> None:
    first = write_calibration(calibration(), tmp_path)
    second = write_calibration(calibration(Estimate(2.8e-5, "kg m2", 1e-7)), tmp_path)
    assert second.parent == first.id != second.id
    assert load_calibration(tmp_path).document() == second.document()
    earlier = load_calibration(tmp_path / f"result-{first.id}.json")
    assert earlier.document() == first.document()
    assert earlier.curve.keys() == {1.5, 2.0}
    assert Calibration.from_document(first.document()).document() == first.document()
    kept = earlier.change.quantities["body.inertia_xx"]
    assert (kept.value, kept.sigma, kept.dof) == (INERTIA.value, INERTIA.sigma, INERTIA.dof)
    assert kept.interval == INERTIA.interval


def test_a_result_that_was_edited_is_noticed(tmp_path: Path) -> None:
    write_calibration(calibration(), tmp_path)
    file = tmp_path / "result.json"
    file.write_text(file.read_text().replace("2.9e-05", "1.9e-05"))
    with pytest.raises(ResultFileError, match="changed after it was written"):
        load_calibration(tmp_path)


@pytest.mark.parametrize("content", ["", "[]", "{}", "null", '{"schema": "perchhw.calibration/1"}'])
def test_what_is_no_result_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "result.json").write_text(content)
    with pytest.raises(ResultFileError):
        load_calibration(tmp_path)


def test_applying_changes_what_was_measured_and_nothing_else(tmp_path: Path) -> None:
    before = load_vehicle(VEHICLE)
    result = write_calibration(calibration(), tmp_path)
    file = tmp_path / "lab.toml"
    file.write_text(vehicle_to_toml(before))
    kept = write_applied(changed_vehicle(before, [result]), file)
    after = load_vehicle(file)
    assert after.body.inertia_xx.value == INERTIA.value
    assert after.body.inertia_xx.sigma == INERTIA.sigma
    assert result.id in after.body.inertia_xx.source
    assert after.body.inertia_yy == before.body.inertia_yy
    assert after.motors.time_constant_up.value == 0.06
    assert after.motors.time_constant_down == before.motors.time_constant_down
    assert after.motors.thrust_map.form.name == "FIRMWARE_CUBIC"
    assert [effect.name for effect in after.effects][-1] == "motor_speed_law"
    assert kept is not None
    assert undo(file) == kept
    assert file.read_text() == vehicle_to_toml(before)
    with pytest.raises(NothingToUndo):
        undo(file)


def test_two_applications_are_undone_one_after_the_other(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    vehicle, texts = load_vehicle(VEHICLE), []
    for value in (2.5e-5, 2.6e-5, 2.7e-5):
        result = write_calibration(calibration(Estimate(value, "kg m2", 1e-7)), tmp_path)
        write_applied(changed_vehicle(vehicle, [result]), file)
        texts.append(file.read_text())
    for text in reversed(texts[:-1]):
        undo(file)
        assert file.read_text() == text


def test_a_quantity_that_no_vehicle_has_is_refused(tmp_path: Path) -> None:
    strange = replace(calibration(), change=VehicleChange(quantities={"body.colour": INERTIA}))
    with pytest.raises(ResultFileError, match=r"body\.colour"):
        changed_vehicle(load_vehicle(VEHICLE), [write_calibration(strange, tmp_path)])


def test_contradicting_calibrations_are_flagged(tmp_path: Path) -> None:
    old = write_calibration(calibration(Estimate(2.0e-5, "kg m2", 1e-7)), tmp_path)
    near = write_calibration(calibration(Estimate(2.01e-5, "kg m2", 1e-7)), tmp_path)
    far = write_calibration(calibration(Estimate(2.1e-5, "kg m2", 1e-7)), tmp_path)
    key = "body.inertia_xx"
    agree = {row.key: row for row in compare_calibrations(old, near)}[key]
    contradict = {row.key: row for row in compare_calibrations(old, far)}[key]
    assert not agree.contradicts
    assert contradict.contradicts
    assert contradict.normalised == pytest.approx(1e-6 / (math.sqrt(2.0) * 1.96e-7), rel=1e-3)
    rows = {row.key for row in compare_with_vehicle(load_vehicle(VEHICLE), far)}
    assert rows == {"body.inertia_xx", "motors.time_constant_up", "thrust at 1.5 V", "thrust at 2 V"}


def test_the_report_stands_alone_and_shows_names_as_text(tmp_path: Path) -> None:
    finding = Finding("few_cycles", Severity.REJECT, "only 5 cycles < 8: twist further")
    result = write_calibration(calibration(findings=(finding,)), tmp_path)
    assert result.rejections == [finding.text]
    path = write_report(tmp_path, result, {}, {"the file": compare_calibrations(result, result)})
    text = path.read_text()
    assert "<b>Person</b>" not in text
    assert "only 5 cycles &lt; 8" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    assert result.id in text


def test_where_no_uncertainty_is_known_nothing_agrees_and_nothing_is_written(tmp_path: Path) -> None:
    few = replace(INERTIA, dof=0.5)  # two swings
    write_calibration(calibration(few), tmp_path)
    result = load_calibration(tmp_path)
    row, known = compare_calibrations(calibration(), result)[:2]
    assert (row.normalised, row.contradicts, as_json(row)["comparable"]) == (None, False, False)
    assert "nobody can say" in row.verdict
    assert known.verdict == "they agree"
    page = write_report(tmp_path, result, {}, {"before": [row]}).read_text()
    assert "they agree" not in page
    with pytest.raises(ResultFileError, match=r"uncertainty of body\.inertia_xx.*more trials"):
        changed_vehicle(load_vehicle(VEHICLE), [result])
