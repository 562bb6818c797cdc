"""``perchhw doctor`` at the simulated lab: all fine, and the room's faults."""

import json
from pathlib import Path
from typing import Any

import pytest

from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab


def doctor(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    code = run(["--json", "doctor", *arguments])
    return code, json.loads(capsys.readouterr().out)


def verdicts(document: Any) -> dict[str, str]:
    return {finding["what"]: finding["verdict"] for finding in document["findings"]}


@pytest.mark.slow
def test_nothing_is_missing_in_the_simulated_lab_and_a_turned_subject_is(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP)) as lab:
        code, document = doctor(capsys, "--drone", lab.drones[0], "--mocap", lab.mocap[0])
        assert (code, document["ok"], document["missing"]) == (0, True, [])
        assert set(verdicts(document).values()) == {"fine"}
        code, document = doctor(capsys, "--lab", lab.ready["lab"])
        assert (code, document["drone"], document["missing"]) == (0, lab.drones[0], [])
        assert run(["doctor", "--lab", lab.ready["lab"]]) == 0
        assert "fine    battery: 4.1" in capsys.readouterr().out

        turned = tmp_path / "turned.toml"
        text = Path(lab.ready["lab"]).read_text(encoding="utf-8")
        assert "quaternion = [0.0, 0.0, 0.0, 1.0]" in text
        turned.write_text(
            text.replace("[0.0, 0.0, 0.0, 1.0]", "[0.7071068, 0.0, 0.0, 0.7071068]"), encoding="utf-8"
        )
        code, document = doctor(capsys, "--lab", str(turned))
        assert (code, document["missing"]) == (1, ["mocap_frame"])
        assert "90.0 deg apart" in str(document["findings"][-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "missing"),
    [
        # That poses are frozen, tests/sim_room finds by the same monitor, and tests/flight/test_attempt.py.
        pytest.param("mocap_freeze_at=0.5:1000", ["mocap"], marks=pytest.mark.soak),
        pytest.param("mocap_occlude_at=0:1000", ["mocap", "mocap_frame"], marks=pytest.mark.further),
    ],
)
def test_a_stale_motion_capture_is_found(
    fault: str, missing: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--fault", fault)) as lab:
        code, document = doctor(capsys, "--drone", lab.drones[0], "--mocap", lab.mocap[0])
    assert (code, document["missing"]) == (1, missing)


def test_nothing_named_is_wrong_usage(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    code, document = doctor(capsys)
    assert code == 2
    assert "--drone" in document["error"]
