"""Raw runs from a simulated bench: fits, uncertainty, units and every finding."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.bench.thrust.analysis import analyse, questions, read_table
from calibration.bench.thrust.checks import check_run
from calibration.bench.thrust.choose import choose, report_forms
from calibration.bench.thrust.compensation import Discharge, read_discharge, verify
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.figures import discharge_figure
from calibration.bench.thrust.law import CUBIC, FORMS, VEHICLE_FORMS
from calibration.bench.thrust.pwm import applied_duty, exact_set_points
from calibration.bench.thrust.raw_table import RawTable, to_data, write_raw
from calibration.bench.thrust.shape import shape_problems
from calibration.bench.thrust.units import Units
from calibration.measurement import Severity
from onboard.battery import duty_for_thrust
from onboard.json_file import as_json
from onboard.thrust_map import ThrustMap
from tests.drawn_examples import examples
from tests.tiers import some
from tests.truth.bench.thrust_stand import CUBICS, GF, record, truth


def table(seed: int = 0, **changes: object) -> RawTable:
    return dataclasses.replace(record("L250", np.random.default_rng(seed), motors=4), **changes)


def codes(run: RawTable) -> dict[str, Severity]:
    return {finding.code: finding.severity for finding in analyse(run).findings}


def test_duty_is_of_eight_bits() -> None:
    assert applied_duty(np.array([0.0, 255.0, 256.0, 65535.0])).tolist() == [
        0.0,
        0.0,
        1.0 / 256.0,
        255.0 / 256.0,
    ]
    points = exact_set_points(25, 0.1)
    assert all(point % 256 == 0 for point in points)
    assert points[-1] == 65280


@pytest.mark.further
@pytest.mark.parametrize("name", some(["L250", "T350", "DC"], 3))
def test_truth_is_recovered_after_drift(name: str) -> None:
    inside, worst = [], 0.0
    for seed in range(6):
        run = record(name, np.random.default_rng(seed), motors=4)
        data = to_data(run)
        voltage = np.linspace(data.voltage.min(), data.voltage.max(), 41)
        reports = report_forms(data, VEHICLE_FORMS)
        chosen = choose(reports)
        expected = truth(name, voltage) / GF
        worst = max(worst, float(np.max(np.abs(reports["firmware_cubic"].fit.thrust_at(voltage) - expected))))
        error = np.abs(chosen.fit.thrust_at(voltage) - expected)
        inside.append(np.mean(error <= chosen.band(voltage, list(reports.values()))))
    assert worst < 0.1
    assert np.mean(inside) > 0.85


def test_straight_drift_is_removed_by_the_tares() -> None:
    run = record("L250", np.random.default_rng(3), drift_g=0.0, noise_g=1e-6, noise_v=1e-9)
    drifting = dataclasses.replace(run, scale=run.scale + 20.0 * GF * run.time / run.time[-1])
    data = to_data(drifting)
    np.testing.assert_allclose(data.thrust, truth("L250", data.voltage), atol=1e-4 * GF)


def test_files_read_back(tmp_path: Path) -> None:
    run = table()
    write_raw(tmp_path / "run.csv", run)
    again = read_table(tmp_path / "run.csv")
    assert isinstance(again, RawTable)
    np.testing.assert_allclose(again.scale, run.scale, atol=1e-4 * GF)
    assert again.kind == run.kind
    assert {
        finding.code for finding in analyse(again).findings if finding.severity is Severity.REJECT
    } == set()


@pytest.mark.parametrize("name", ["L250", "T350", "P250", "DC"])
@pytest.mark.parametrize("seed", range(3))
def test_wrong_units_are_asked_about(name: str, seed: int) -> None:
    run = record(name, np.random.default_rng(seed), motors=4)
    assert questions(run) == []
    newtons = dataclasses.replace(run, scale=run.scale * GF)  # N that were read as g
    wrong = {
        "unit_thrust": [
            newtons,
            dataclasses.replace(run, scale=run.scale / GF),
            dataclasses.replace(run, motors=np.ones(run.motors.size)),
            dataclasses.replace(run, scale=run.scale / 4.0),
            dataclasses.replace(run, scale=run.scale / 28.35),
        ],
        "unit_voltage": [dataclasses.replace(run, supply=run.supply * 1e3, board=run.board * 1e3)],
        "unit_command": [dataclasses.replace(run, command=np.rint(run.command / 256.0), supply=run.supply)],
    }
    for code, runs in wrong.items():
        for one in runs:
            found = {finding.code: finding for finding in questions(one)}
            assert found[code].severity is Severity.REJECT, code
            with pytest.raises(ThrustTableError, match="read the table again"):
                analyse(one)
    assert "reading in N?" in questions(newtons)[0].text


def test_units_that_are_said_are_used(tmp_path: Path) -> None:
    run = table()
    write_raw(tmp_path / "run.csv", run)
    lines = (tmp_path / "run.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        row[3] = str(int(row[3]) // 256)
        row[6] = repr(float(row[6]) * GF)
    (tmp_path / "odd.csv").write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    again = read_table(tmp_path / "odd.csv", Units(force="N", full_scale=255))
    assert isinstance(again, RawTable)
    np.testing.assert_allclose(to_data(again).thrust, to_data(run).thrust, atol=1e-5)
    with pytest.raises(ThrustTableError, match="choose one of"):
        Units(force="lb")


def test_each_fault_has_its_finding() -> None:
    run = table()
    clean = codes(run)
    assert set(clean) <= {"few_low", "few_high"}
    n = run.time.size
    pointing = run.pointing
    later = run.time > run.time[n // 2]
    faults = {
        "brown_out": {"time": np.where(later, run.time - 50.0, run.time)},
        "scale_saturated": {"scale": np.minimum(run.scale, 38.0 * GF)},
        "board_above_supply": {"board": run.board + 0.2},
        "supply_limit": {"supply": np.where(pointing & (run.command > 40000), run.supply - 0.5, run.supply)},
        "battery": {"supply": run.supply - 0.3 * run.time / run.time[-1], "board": run.board - 0.3},
        "tare_drift": {"scale": run.scale + 0.6 * GF * run.time / run.time[-1]},
    }
    for code, change in faults.items():
        assert code in codes(dataclasses.replace(run, **change)), code
    with pytest.raises(ThrustTableError, match="the right way round"):
        analyse(dataclasses.replace(run, scale=-run.scale))
    with pytest.raises(ThrustTableError, match="has no tare"):
        analyse(dataclasses.replace(run, kind=tuple("point" for _ in run.kind)))


@pytest.mark.parametrize("name", some(["L250", "T350", "DC"], 3))
@pytest.mark.parametrize("seed", some(range(2), 2))
def test_one_point_that_strays_is_told_and_scatter_is_not(name: str, seed: int) -> None:
    run = record(name, np.random.default_rng(seed), motors=4)
    assert "stray_point" not in [finding.code for finding in analyse(run).findings]
    slipped = run.command.copy()
    slipped[np.flatnonzero(run.rows("point"))[7]] = 0.0  # a command that was left out, its thrust kept
    findings = analyse(dataclasses.replace(run, command=slipped)).findings
    told = [finding for finding in findings if finding.code == "stray_point"]
    assert [finding.severity for finding in told] == [Severity.WARNING]
    assert "the point at 0.000 V" in told[0].text


def test_a_point_far_below_zero_strays_and_one_that_nothing_reads_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    rows = [f"{volt},{2.0 * volt * volt:.3f}" for volt in np.arange(1.0, 3.8, 0.2)]
    path.write_text("\n".join(["voltage,thrust", *rows, "2.1,-1000"]))
    (told,) = [one for one in analyse(read_table(path)).findings if one.code == "stray_point"]
    assert "the point at 2.100 V" in told.text
    refused = {"2.1,1e300": "'thrust': '1e300' is beyond 1e", "-1,2": "'voltage': -1 V is below 0"}
    for row, words in refused.items():
        path.write_text("\n".join(["voltage,thrust", row, *rows]))
        with pytest.raises(ThrustTableError, match=f"row 2 column {words}"):
            read_table(path)


def test_a_voltage_below_zero_is_refused_by_its_row(tmp_path: Path) -> None:
    run = table()
    board = run.board.copy()
    board[5] = -board[5]
    write_raw(tmp_path / "run.csv", dataclasses.replace(run, board=board))
    with pytest.raises(ThrustTableError, match=r"row 7 column 'board_v': -.* is below 0"):
        read_table(tmp_path / "run.csv")


@pytest.mark.further
def test_curves_that_disagree_are_found() -> None:
    two = record("L250", np.random.default_rng(0), motors=4, supplies=(3.5, 4.1))
    assert "supplies_differ" not in codes(two)
    off = dataclasses.replace(two, board=np.where(two.block == 1.0, two.board * 0.95, two.board))
    assert "supplies_differ" in codes(off)
    run = table()
    half = np.random.default_rng(1).random(run.time.size) < 0.5
    for first, second, code in (("up", "down", "hysteresis"), ("point", "raised", "raised")):
        kind = tuple(
            k if k == "tare" else (second if h else first) for k, h in zip(run.kind, half, strict=True)
        )
        alike = dataclasses.replace(run, kind=kind)
        assert code not in codes(alike)
        weaker = dataclasses.replace(alike, scale=run.scale * np.where(half & run.pointing, 0.93, 1.0))
        assert code in codes(weaker)
    repeats = tuple("repeat" if k == "point" else k for k in run.kind)
    same = dataclasses.replace(run, kind=repeats, command=np.where(run.pointing, 40960.0, 0.0))
    assert "repeats_differ" in {finding.code for finding in check_run(same)}


def test_missing_propeller_shows_against_the_map_so_far() -> None:
    run = table()
    weak = dataclasses.replace(run, scale=run.scale * 0.7)
    result = analyse(weak, expected=lambda v: float(truth("L250", np.array(v))))
    assert "low_thrust" in {finding.code for finding in result.findings}


def test_curves_that_may_not_fly_are_refused() -> None:
    falling = ThrustMap(1, np.array([-0.01, 0.05, -0.03, 0.004, 0.0, 0.0, 0.0, 0.0]))
    assert any("does not rise" in text for text in shape_problems(falling, 0.005, 0.1))
    jump = ThrustMap(0, np.array([0.618, 1.394, 0.0, 2.097, -4.464, 5.636, 5.0, 0.0]) * GF)
    assert any("a jump of" in text for text in shape_problems(jump, 0.005, 0.1))
    good = ThrustMap(1, np.array([*CUBICS["L250"], 0.0, 0.0, 0.0, 0.0]))
    assert shape_problems(good, 0.0128, 0.12) == []


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_forms_invert(form) -> None:
    voltage = np.linspace(1.0, 3.0, 15)
    parameters = form.start(voltage, truth("L250", voltage) / GF)
    thrust = form.thrust(parameters, voltage)
    np.testing.assert_allclose(form.voltage(parameters, thrust), voltage, atol=1e-6)


def discharge(error: float = 0.0, motors: float = 1.0) -> Discharge:
    battery = np.linspace(4.2, 3.2, 200)
    cubic = ThrustMap(1, np.array([*CUBICS["L250"], 0.0, 0.0, 0.0, 0.0]))
    asked = np.where(np.arange(200) % 40 < 20, 8.0, 16.0) * GF
    command = np.floor([65535.0 * duty_for_thrust(f, v, cubic) for f, v in zip(asked, battery, strict=True)])
    given = truth("L250", applied_duty(command) * battery) * (1.0 + error) * motors
    return Discharge(np.arange(200) * 1.0, battery, asked, given, command)


def test_discharge_is_verified_and_saturation_reported() -> None:
    run = discharge()
    result = verify(run)
    assert result.passed
    assert result.saturated_below == pytest.approx(3.35, abs=0.15)
    assert [finding.code for finding in result.findings] == ["saturated"]
    assert as_json(result)["passed"]
    assert discharge_figure(run, result).axes
    off = verify(discharge(error=-0.08))
    assert not off.passed
    assert [finding.code for finding in off.findings if finding.severity is Severity.WARNING] == [
        "compensation_off"
    ]


@pytest.mark.parametrize(("chosen", "told"), [(slice(0, 4), "3 settled"), (slice(0, 40), "38 settled")])
def test_too_few_readings_or_one_voltage_do_not_pass(chosen: slice, told: str) -> None:
    run = discharge()
    columns = {one.name: getattr(run, one.name)[chosen] for one in dataclasses.fields(run)}
    result = verify(Discharge(**columns))
    assert not result.passed
    (finding,) = result.findings
    assert finding.code == "short_discharge"
    assert told in finding.text


def test_discharge_files(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("t_s,battery_v,asked_gf,command,scale_g,motors\n0,4.1,8,38400,32,4\n1,4.0,8,38912,32,4\n")
    assert verify(read_discharge(path)).worst_gf == pytest.approx(0.0, abs=1e-9)
    path.write_text("t_s,battery_v\n0,4.1\n")
    with pytest.raises(ThrustTableError, match="expected"):
        read_discharge(path)


def test_a_discharge_without_readings_or_with_two_clocks_is_not_judged(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("t_s,battery_v,asked_gf,command,scale_g,motors\n")
    with pytest.raises(ThrustTableError, match="no readings"):
        read_discharge(path)
    hover = [f"{t},4.1,{8 if t < 50 else 9},38400,{32 if t < 50 else 36},4" for t in range(60)]
    strong_but_weak = [f"{t},4.1,16,50000,48,4" for t in range(40)]
    path.write_text("\n".join(["t_s,battery_v,asked_gf,command,scale_g,motors", *hover, *strong_but_weak]))
    with pytest.raises(ThrustTableError, match="row 62 column 't_s': time goes back"):
        read_discharge(path)


def test_a_form_that_falls_is_not_chosen() -> None:
    voltage = np.linspace(0.5, 3.0, 12)
    x = voltage - 1.75
    dip = ThrustData("x", "x", voltage, (8.0 + 6.0 * (x**3 - 0.6 * x)) * GF, np.arange(12.0) % 5)
    result = analyse(dip)
    assert result.forms["firmware_cubic"].cross_validation < 0.1
    assert not result.forms["firmware_cubic"].usable
    assert any("does not rise" in text for text in result.forms["firmware_cubic"].problems)
    assert result.chosen == "two_region_log"
    with pytest.raises(ThrustTableError, match="at least 8"):
        ThrustData("x", "x", voltage[:5], voltage[:5], voltage[:5])


@settings(max_examples=examples(40))
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "t.csv"
    for head in (
        "",
        "t_s,block,kind,command,supply_v,board_v,scale,motors\n",
        "voltage,thrust\n",
        "motor,region,a,b,c\n",
    ):
        path.write_text(head + text, encoding="utf-8", errors="ignore")
        try:
            content = read_table(path)
            if isinstance(content, RawTable | ThrustData):
                analyse(content)
        except ThrustTableError:
            continue


def test_cubic_leads_in_ties() -> None:
    run = record("L250", np.random.default_rng(5), motors=4)
    assert choose(report_forms(to_data(run), VEHICLE_FORMS)).name == CUBIC.name
