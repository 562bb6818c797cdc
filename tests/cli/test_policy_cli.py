"""``perchhw policy`` from its command line."""

import json

import numpy as np
import pytest

from onboard.policy.bundle import decode_bundle, encode_bundle
from onboard.policy.files import load_policy, policy_crc32, save_policy
from perchhw.cli.main import run
from tests.link.tiny_drone import TinyDrone
from tests.onboard.policies import small_policy
from tests.tiers import some


@pytest.fixture
def policy_file(tmp_path):
    path = tmp_path / "small.policy.json"
    save_policy(small_policy(), path)
    return path


@pytest.fixture
def states(tmp_path):
    def write(text):
        path = tmp_path / "states.csv"
        path.write_text(text)
        return path

    return write


def document(capsys):
    return json.loads(capsys.readouterr().out)


def test_eval_by_the_onboard_arithmetic(policy_file, states, capsys):
    table = states("d_ceil,note,tau,theta_x\n0.5,near,0.25,4\n0.5,,inf,4\n\n0.5,,0.3125,-2\n")
    assert run(["--json", "policy", "eval", str(policy_file), "--states", str(table)]) == 0
    rows = document(capsys)["rows"]
    assert [set(row) for row in rows] == [{"trigger_value", "triggers", "a_rot"}] * 3
    assert [row["triggers"] for row in rows] == [True, False, False]
    assert rows[0]["trigger_value"] == pytest.approx(0.0362198, abs=1e-6)
    assert rows[0]["a_rot"] == pytest.approx(-0.007411939, abs=1e-9)
    assert rows[1]["trigger_value"] == -1.0


def test_eval_of_the_flown_policy(shared_data, tmp_path, states, capsys):
    source = shared_data / "habas2022/policy/flown_policy.json"
    target = tmp_path / "flown.policy.json"
    assert run(["--json", "policy", "import", str(source), "--out", str(target)]) == 0
    assert document(capsys)["crc32"] == policy_crc32(load_policy(target))
    # The trigger snapshot of the flight 1.75_30.00_10-27_11-31, which flew -7.64 N mm.
    table = states("tau,theta_x,d_ceil\n0.2265,5.595,0.252\n")
    assert run(["policy", "--json", "eval", str(target), "--states", str(table)]) == 0
    (row,) = document(capsys)["rows"]
    assert row["triggers"] is True
    assert row["a_rot"] == pytest.approx(-7.64e-3, abs=0.05e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("tau,theta_x\n0.2,1\n", ["line 1", "d_ceil"]),
        ("", ["line 1", "tau", "nothing"]),
        ("tau,theta_x,d_ceil\n0.2,1,0.5\n0.2,fast,0.5\n", ["line 3", "theta_x", "fast"]),
        ("tau,theta_x,d_ceil\n0.2,1,\n", ["line 2", "d_ceil"]),
        ("tau,theta_x,d_ceil\n0.2,1\n", ["line 2", "d_ceil", "missing"]),
        ("tau,theta_x,d_ceil,tau\n0.2,1,0.5,0.3\n", ["line 1", "given twice: tau"]),
        ("tau,theta_x,d_ceil\nnan,1,1\n", ["line 2", "tau", "nan"]),
    ],
)
def test_eval_names_file_row_and_column(policy_file, states, capsys, text, words):
    table = states(text)
    assert run(["--json", "policy", "eval", str(policy_file), "--states", str(table)]) == 2
    captured = capsys.readouterr()
    message = json.loads(captured.out)["error"]
    assert message in captured.err.replace("\n", "")
    assert all(word in message for word in ["states.csv", *words]), message


def test_eval_without_its_files(policy_file, tmp_path, capsys):
    assert run(["policy", "eval", str(policy_file), "--states", str(tmp_path / "none.csv")]) == 2
    assert run(["policy", "eval", str(tmp_path / "none.policy.json"), "--states", "x.csv"]) == 2
    assert run(["policy", "eval", str(policy_file)]) == 2
    capsys.readouterr()


def test_show(policy_file, capsys):
    assert run(["--json", "policy", "show", str(policy_file)]) == 0
    shown = document(capsys)
    assert shown["crc32"] == policy_crc32(small_policy())
    assert shown["layer_sizes"] == [3, 2, 1]
    assert run(["policy", "show", str(policy_file)]) == 0
    assert f"0x{policy_crc32(small_policy()):08x}" in capsys.readouterr().out


def test_export_and_import_of_the_bundle(policy_file, tmp_path, capsys):
    bundle, again = tmp_path / "small.bin", tmp_path / "again.policy.json"
    assert run(["--json", "policy", "export", str(policy_file), "--out", str(bundle)]) == 0
    assert document(capsys)["bytes"] == 164
    assert encode_bundle(decode_bundle(bundle.read_bytes())) == encode_bundle(small_policy())
    assert run(["--json", "policy", "import", str(bundle), "--out", str(again), "--name", "again"]) == 0
    assert document(capsys)["crc32"] == policy_crc32(small_policy())
    assert load_policy(again).name == "again"


def test_import_writes_here_by_default_and_overwrites_nothing(policy_file, tmp_path, capsys, monkeypatch):
    bundle, here = tmp_path / "flown.bin", tmp_path / "here"
    assert run(["policy", "export", str(policy_file), "--out", str(bundle)]) == 0
    here.mkdir()
    monkeypatch.chdir(here)
    assert run(["policy", "import", str(bundle)]) == 0
    written = here / "flown.policy.json"
    assert load_policy(written).name == "flown"
    assert encode_bundle(load_policy(written)) == encode_bundle(small_policy())
    written.write_text("mine")
    capsys.readouterr()
    assert run(["policy", "import", str(bundle)]) == 2
    assert "flown.policy.json: is there already" in capsys.readouterr().err
    assert written.read_text() == "mine"
    assert run(["--json", "policy", "import", str(bundle), "--force"]) == 0
    assert document(capsys)["policy"] == "flown.policy.json"
    assert load_policy(written).name == "flown"
    assert run(["policy", "import", str(bundle), "--name", "second"]) == 0
    assert run(["policy", "import", str(bundle), "--name", "../up"]) == 2
    assert sorted(p.name for p in here.iterdir()) == ["flown.policy.json", "second.policy.json"]
    assert not (tmp_path / "up.policy.json").exists()


def test_a_damaged_policy_is_refused_with_what_to_do(policy_file, tmp_path, capsys):
    text = policy_file.read_text()
    policy_file.write_text(text.replace("0.25", "0.26", 1))
    assert run(["policy", "show", str(policy_file)]) == 2
    assert "damaged" in capsys.readouterr().err
    bundle = tmp_path / "damaged.bin"
    bundle.write_bytes(encode_bundle(small_policy())[:-4] + np.float32(np.nan).tobytes())
    assert run(["policy", "show", str(bundle)]) == 2
    assert "CRC" in capsys.readouterr().err
    assert run(["policy", "export", str(tmp_path / "none.bin"), "--out", str(tmp_path / "x.bin")]) == 2
    assert not (tmp_path / "x.bin").exists()
    capsys.readouterr()


@pytest.fixture
def drone():
    with TinyDrone() as served:
        yield served


def test_upload_then_verify_over_a_real_link(policy_file, drone, capsys):
    crc = policy_crc32(small_policy())
    assert run(["--json", "policy", "verify", str(policy_file), "--drone", drone.uri]) == 1
    assert document(capsys) == {"drone": drone.uri, "matches": False, "crc32": 0, "expected_crc32": crc}
    assert run(["--json", "policy", "upload", str(policy_file), "--drone", drone.uri]) == 0
    assert document(capsys)["crc32"] == crc
    assert bytes(drone.memory[:164]) == encode_bundle(small_policy())
    assert run(["--json", "policy", "verify", str(policy_file), "--drone", drone.uri]) == 0
    assert document(capsys)["matches"] is True


def test_verify_names_another_policy(policy_file, drone, capsys):
    drone.values["perch.polActCrc"] = 0x1234
    assert run(["policy", "verify", str(policy_file), "--drone", drone.uri]) == 1
    assert "0x00001234" in capsys.readouterr().out


def test_a_damaged_policy_never_reaches_the_drone(policy_file, drone, capsys):
    policy_file.write_text(policy_file.read_text().replace("0.25", "0.26", 1))
    assert run(["policy", "upload", str(policy_file), "--drone", drone.uri]) == 2
    assert drone.requests == []
    capsys.readouterr()


@pytest.mark.parametrize("verb", some(["upload", "verify"], 2))
def test_a_drone_that_flies_is_not_even_connected_to(policy_file, drone, verb, capsys):
    drone.supervisor_bits = 0x1B  # armed and flying
    assert run(["policy", verb, str(policy_file), "--drone", drone.uri]) == 3
    assert "is flying" in capsys.readouterr().err
    assert {request[0] & 0xF3 for request in drone.requests} == {0x90}  # asked, and nothing else
    assert drone.memory[:164] == bytes(164)
