"""The root of the command line: help, global flags, exit codes."""

import json
import os
import pty
import subprocess
import sys

import pytest

from onboard.errors import InputError, PerchhwError, SafetyStop
from perchhw.cli import main as root_module
from perchhw.cli.main import VERBS, hoist_global_flags, run
from perchhw.cli.output import settings


def test_help_lists_every_verb_without_importing_any() -> None:
    code = (
        "import sys; from perchhw.cli.main import run; code = run(['--help']);"
        "heavy = {'numba', 'numpy', 'cflib', 'torch', 'matplotlib'} & set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in VERBS:
        assert name in done.stdout


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([verb, "--help"]) == 0
    assert "Usage: perchhw" in capsys.readouterr().out


def test_the_help_of_options_is_that_of_their_tables_and_imports_no_row() -> None:
    code = (
        "import sys; from dataclasses import replace;"
        "from calibration.bench.instruments.schemes import SCALES, SUPPLIES;"
        "from calibration.flight_formats import FLIGHT_FORMATS; from mocap_bridge.uri import SCHEMES;"
        "SCALES['mine'] = replace(SCALES['mtsics'], example='mine:///dev/scale');"
        "SUPPLIES['mine'] = replace(SUPPLIES['korad'], example='mine:///dev/supply');"
        "FLIGHT_FORMATS['my_lab'] = 'my_lab.FORMAT'; SCHEMES['my-room'] = SCHEMES['vicon'];"
        "from perchhw.cli.bench_options import Scale, Supply; from perchhw.cli.options import FlightFormat;"
        "heavy = {'numba', 'numpy', 'cflib', 'torch', 'matplotlib', 'serial'} & set(sys.modules);"
        "from perchhw.cli.mocap import watch; Source = watch.__annotations__['uri'];"
        "print(*(option.__metadata__[0].help for option in (Scale, Supply, FlightFormat, Source)));"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for told in ("mine:///dev/scale", "mine:///dev/supply", "my_lab", "my-room://HOST", "manual://"):
        assert told in done.stdout


@pytest.mark.parametrize("arguments", [["no-such-verb"], ["fly"], ["fly", "--no-such-option"]])
def test_wrong_usage_exits_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e999"])
@pytest.mark.parametrize(
    "command",
    [
        ["fly", "--angle", "50", "--speed"],
        ["log", "export", "RUN", "--to", "csv", "--rate"],
        ["check", "hover", "--seconds"],
        ["gap", "suggest", "--report", "report.json", "--vehicle", "crazyflie21-stock", "--ceiling"],
        ["bringup", "--step", "landing", "--angle"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_number_that_is_not_finite_is_wrong_usage_of_its_option(
    command: list[str], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command[:-1], f"{command[-1]}={word}"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"error: {command[-1]}: {float(word)} is not a finite number" in said or (
        f"Invalid value for '{command[-1]}': Input should be" in said  # it has limits of its own
    )


def test_global_flags_may_stand_anywhere_before_the_double_dash() -> None:
    assert hoist_global_flags(["vehicle", "list", "--json"]) == ["--json", "vehicle", "list"]
    assert hoist_global_flags(["-v", "x", "--", "--json"]) == ["-v", "x", "--", "--json"]


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (PerchhwError("a"), 1),
        (InputError("b"), 2),
        (SafetyStop("c"), 3),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_become_exit_codes(
    error: BaseException, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_called: str | None) -> None:
        raise error

    monkeypatch.setattr(root_module, "_command_line", fail)
    assert run(["vehicle"]) == code
    assert capsys.readouterr().err.strip()
    assert run(["vehicle", "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    assert document["exit_code"] == code
    assert document["error"] == (str(error) or "interrupted")


@pytest.mark.parametrize(
    "arguments", ["policy show", "vehicle show", "campaign status", "log report", "calibrate verify", "view"]
)
def test_a_path_that_the_system_refuses_is_told_in_a_sentence(
    arguments: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Too long a name: the tests may be run by somebody who may look into every folder."""
    name = 300 * "x"
    assert run([*arguments.split(), name]) == 2
    assert f"error: {name}" in (said := capsys.readouterr().err).replace("\n", "")
    assert "check the path" in said.replace("\n", " ")
    assert run(["--json", *arguments.split(), name]) == 2
    assert json.loads(capsys.readouterr().out)["exit_code"] == 2


@pytest.mark.parametrize("part", ["lab", "drone", "room", "bench"])
def test_a_seed_that_is_none_is_refused_before_anything_is_served(
    part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["sim", part, "--seed", "-1"]) == 2
    assert "Invalid value for '--seed'" in capsys.readouterr().err


def test_wrong_usage_gives_a_script_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fly", "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["exit_code"] == 2


def test_json_flag_is_set_for_the_verb(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "as_json", False)
    run(["vehicle", "list", "--json"])
    assert settings.as_json


def test_what_a_terminal_has_no_letter_for_costs_no_result() -> None:
    """Bytes of another encoding in a path; letters of ours on a terminal in ASCII."""
    line = [sys.executable, "-m", "perchhw", "vehicle", "check", b"no-\xfc.toml"]
    for encoding in ("utf-8:strict", "ascii"):
        done = subprocess.run(
            line, env=os.environ | {"PYTHONIOENCODING": encoding}, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (2, "")
        assert "\\udcfc.toml" in done.stdout


@pytest.mark.parametrize("flags", [[], ["--json"]])
def test_a_reader_that_is_gone_changes_no_exit_code(flags: list[str]) -> None:
    """``perchhw ... | head``: what came of the verb is no less true."""
    reader, writer = os.pipe()
    os.close(reader)
    line = [sys.executable, "-m", "perchhw", *flags, "vehicle", "list"]
    done = subprocess.run(line, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_terminal_that_is_gone_changes_no_exit_code() -> None:
    terminal, end = pty.openpty()
    line = [sys.executable, "-m", "perchhw", "vehicle", "show", "no-such-vehicle"]
    with subprocess.Popen(line, stdout=end, stderr=end) as process:
        os.close(end)
        os.close(terminal)
    assert process.returncode == 2
