"""Who ends a command, by whatever signal and however often, gets its exit code and its document."""

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.cli import main as root_module
from perchhw.cli.main import run
from tests.patience import PATIENCE_S
from tests.tiers import some


@pytest.mark.parametrize("how", some(["SIGTERM", "SIGINT", "SIGHUP"], 3))
def test_a_verb_that_flies_nothing_ends_in_order(how: str) -> None:
    """While it waits for a drone that does not answer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
        drone.bind(("127.0.0.1", 0))
        drone.settimeout(PATIENCE_S)
        uri = f"udp://127.0.0.1:{drone.getsockname()[1]}?connect_s={PATIENCE_S}"
        line = [sys.executable, "-m", "perchhw", "--json", "policy", "verify", "default", "--drone", uri]
        running = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            drone.recv(64)
            running.send_signal(getattr(signal, how))
            said, errors = running.communicate()
        finally:
            running.kill()
    assert running.returncode == 130, errors
    assert json.loads(said) == {"error": "interrupted", "exit_code": 130}
    assert "Traceback" not in errors


def test_one_more_signal_while_the_first_is_told_costs_no_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = root_module.progress_console

    def interrupted() -> object:
        signal.raise_signal(signal.SIGINT)
        return real()

    def end(_called: str | None) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(root_module, "_command_line", end)
    monkeypatch.setattr(root_module, "progress_console", interrupted)
    assert run(["vehicle", "--json"]) == 130
    assert json.loads(capsys.readouterr().out)["error"] == "interrupted"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_who_interrupts_the_loading_of_the_command_line_sees_no_traceback(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("print('loading', flush=True)\ninput()\n")
    running = subprocess.Popen(
        [sys.executable, "-m", "perchhw", "vehicle", "list"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stdout is not None
    assert running.stdout.readline() == "loading\n"
    running.send_signal(signal.SIGINT)
    errors = running.communicate()[1]
    assert (running.returncode, errors) == (-signal.SIGINT, "")


@pytest.mark.usefixtures("own_drone_files")
def test_an_outcome_is_told_before_the_page_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C while it is drawn costs the page, not what came of the flight."""

    def landed(request: AttemptRequest, **_: object) -> AttemptResult:
        return AttemptResult(Outcome.FOUR_LEG, True, None, None, request.folder)

    def interrupted(_folder: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("perchhw.flight.fly_attempt", landed)
    monkeypatch.setattr("perchhw.report.run_report.report_flight", interrupted)
    monkeypatch.chdir(tmp_path)
    where = ["--drone", "udp://127.0.0.1:1", "--mocap", "vicon://127.0.0.1:1?subject=cf1"]
    assert run(["--json", "fly", *where, "--speed", "2.5", "--angle", "50"]) == 130
    assert json.loads(capsys.readouterr().out)["outcome"] == "four_leg"


@pytest.mark.usefixtures("own_drone_files")
def test_the_page_of_a_flight_is_named_once_it_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def landed(request: AttemptRequest, **_: object) -> AttemptResult:
        return AttemptResult(Outcome.FOUR_LEG, True, None, None, request.folder)

    pages = iter([tmp_path / "a" / "report.html", None])
    monkeypatch.setattr("perchhw.flight.fly_attempt", landed)
    monkeypatch.setattr("perchhw.report.run_report.report_flight", lambda _: next(pages))
    monkeypatch.chdir(tmp_path)
    line = ["fly", "--drone", "udp://127.0.0.1:1", "--mocap", "vicon://127.0.0.1:1?subject=cf1"]
    line += ["--speed", "2.5", "--angle", "50"]
    assert run(line) == 0
    assert f"report: {tmp_path / 'a' / 'report.html'}" in capsys.readouterr().err.splitlines()
    assert run(line) == 0
    assert "report:" not in capsys.readouterr().err


def test_a_verb_that_was_interrupted_in_the_text_of_a_dataclass_keeps_its_exit_code(tmp_path: Path) -> None:
    """Else Python dies of SIGINT whatever the exit code: a class is made by running text."""
    (tmp_path / "interrupted.py").write_text(
        "import perchhw.cli.main as root\n"
        "def end(_called):\n"
        "    root.progress_console().print('all that speaks is loaded, and runs no more text')\n"
        "    exec('raise KeyboardInterrupt')\n"
        "root._command_line = end\n"
        "root.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "interrupted", "--json", "vehicle"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 130, done.stderr
    assert json.loads(done.stdout) == {"error": "interrupted", "exit_code": 130}
