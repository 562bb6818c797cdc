"""Root of the command line: global flags, verbs imported when called, and how errors become exit codes."""

import errno
import gc
import importlib
import io
import logging
import os
import signal
import sys
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import typer

from onboard.errors import EndedByOperator, InputError, PerchhwError, SafetyStop
from perchhw.cli import exit_codes
from perchhw.cli.finite_numbers import with_finite_numbers
from perchhw.cli.output import emit_error, settings, written
from perchhw.cli.view_option import complete_view_option
from perchhw.consoles import progress_console, say
from perchhw.operator_signals import CUT, ENDS, LAND, act_as_ctrl_c, known, unheard

_GARBAGE_THRESHOLDS = (20_000, 50, 100)
"""Of Python's collector. By default it runs 500 times while a flight's program is loaded and its page is
drawn, where there is nothing to collect: a tenth of their time."""
_GLOBAL_FLAGS = ("--json", "-v", "--verbose")
_ON_DEVICES = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Where a file cannot be used, and its path is not what is wrong."""

_log = logging.getLogger(__name__)


class Verb(NamedTuple):
    """Where a verb lives and what it does, known without importing it; `group` has verbs of its own."""

    module: str
    help: str
    group: bool = True


VERBS: dict[str, Verb] = {
    "demo": Verb(
        "perchhw.cli.demo", "Fly approaches in a simulated lab, from policy to report.", group=False
    ),
    "sim": Verb("perchhw.cli.sim", "Serve the simulated lab, drone, mocap room or bench until interrupted."),
    "doctor": Verb("perchhw.cli.doctor", "Say what a flight lacks, and what to do about it.", group=False),
    "fly": Verb("perchhw.cli.fly", "Fly one supervised landing attempt.", group=False),
    "rehearse": Verb(
        "perchhw.cli.rehearse",
        "Rehearse an approach on the desk: the drone computes, nothing turns.",
        group=False,
    ),
    "bringup": Verb(
        "perchhw.cli.bringup", "Climb the ladder to the first flight, step by step.", group=False
    ),
    "check": Verb("perchhw.cli.check", "Fly the morning's question: the same drone as yesterday?"),
    "stop": Verb("perchhw.cli.stop", "Cut the motors of drones now, from any terminal.", group=False),
    "campaign": Verb("perchhw.cli.campaign", "Fly a grid of attempts; resume, status, report."),
    "policy": Verb("perchhw.cli.policy", "Show, import, export, evaluate, upload and verify policies."),
    "learn": Verb("perchhw.cli.learn", "Learn a landing policy in simulation."),
    "calibrate": Verb("perchhw.cli.calibrate", "Measure inertia, motors and thrust on the bench."),
    "gap": Verb("perchhw.cli.gap", "Find where the model and measured flights disagree."),
    "vehicle": Verb("perchhw.cli.vehicle", "List, show, check and compare vehicle files."),
    "mocap": Verb("perchhw.cli.mocap", "Watch a mocap source, send it on, measure the room."),
    "mavlink": Verb("perchhw.cli.mavlink", "Tell a ground station of a drone or of a record."),
    "view": Verb("perchhw.cli.view", "Show a flight, while it is flown or afterwards.", group=False),
    "log": Verb("perchhw.cli.log", "List, export, label, report and view recorded flights."),
    "completion": Verb(
        "perchhw.cli.completion", "Print a script that makes bash, zsh or fish complete perchhw.", group=False
    ),
}


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"perchhw {version('perchhw')}")
        raise typer.Exit


def _set_global_flags(
    as_json: Annotated[bool, typer.Option("--json", help="Exactly one JSON document on stdout.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say more on stderr.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Land a Crazyflie upside down on a ceiling: learn, upload, fly, record, measure."""
    settings.as_json = as_json
    logging.basicConfig(
        level=logging.INFO if verbose else logging.ERROR, stream=sys.stderr, format="%(name)s: %(message)s"
    )


def _exit_with(result: Any, **_flags: Any) -> None:
    """A verb's integer result is the exit code."""
    if isinstance(result, int) and result:
        raise typer.Exit(result)


def _not_imported() -> None:
    """Stands for a verb that was not called."""


def _command_line(called: str | None) -> typer.Typer:
    """The application with every verb in its help and only `called` imported."""
    app = typer.Typer(
        add_completion=False,
        callback=_set_global_flags,
        result_callback=_exit_with,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for name, verb in VERBS.items():
        if name != called:
            app.command(name, help=verb.help)(_not_imported)
            continue
        verbs: typer.Typer = importlib.import_module(verb.module).app
        if verb.group:
            app.add_typer(verbs, name=name, help=verb.help, result_callback=_exit_with, no_args_is_help=True)
        else:
            app.command(name)(verbs.registered_commands[0].callback or _not_imported)
    return app


def hoist_global_flags(arguments: Sequence[str]) -> list[str]:
    """The arguments with the global flags first, so that they may stand anywhere before ``--``."""
    limit = list(arguments).index("--") if "--" in arguments else len(arguments)
    flags = [a for a in arguments[:limit] if a in _GLOBAL_FLAGS]
    others = [a for a in arguments[:limit] if a not in _GLOBAL_FLAGS]
    return [*flags, *others, *arguments[limit:]]


def run(arguments: Sequence[str]) -> int:
    """Run one command line and give its exit code."""
    ordered = hoist_global_flags(complete_view_option(arguments))
    called = next((a for a in ordered if not a.startswith("-")), None)
    settings.as_json, settings.emitted = "--json" in ordered, False
    try:
        with_finite_numbers(typer.main.get_command(_command_line(called)))(ordered, prog_name="perchhw")
    except OSError as refused:
        if refused.filename is None:
            raise
        with unheard():
            return _refused(refused)
    except (SystemExit, KeyboardInterrupt, PerchhwError) as ended:
        with unheard():
            return _told(ended)
    return exit_codes.DONE


def _refused(refused: OSError) -> int:
    """Say which file the system does not give, such as one in a folder that others may not look into: a verb
    that only asks whether it is there is told so by an error, too.
    """
    _log.info("the system refused a file", exc_info=refused)
    message = f"error: {refused.filename}: cannot be used ({refused.strerror}); check "
    if refused.errno in _ON_DEVICES:
        return _ended_by(f"{message}the disk", exit_codes.FAILED)
    return _ended_by(f"{message}the path, and who may use it", exit_codes.USAGE)


def _told(ended: SystemExit | KeyboardInterrupt | PerchhwError) -> int:
    """Say how a verb ended, and give its exit code."""
    if isinstance(ended, KeyboardInterrupt):
        return _ended_by("interrupted", exit_codes.INTERRUPTED)
    if isinstance(ended, EndedByOperator):
        return _ended_by(str(ended), exit_codes.INTERRUPTED)
    if isinstance(ended, PerchhwError):
        return _ended_by(f"error: {ended}", _exit_code(ended))
    code = ended.code if isinstance(ended.code, int) else exit_codes.DONE
    if code == exit_codes.USAGE:
        emit_error("wrong usage: the message is on stderr", code)
    if code == exit_codes.INTERRUPTED:  # typer ends a verb so, without a word
        return _ended_by("interrupted", code)
    return code


def _exit_code(error: PerchhwError) -> int:
    if isinstance(error, SafetyStop):
        return exit_codes.SAFETY
    return exit_codes.USAGE if isinstance(error, InputError) else exit_codes.FAILED


def _ended_by(message: str, exit_code: int) -> int:
    """Tell the person on stderr, and the script that asked for JSON on stdout."""
    written(sys.stderr, lambda: say(progress_console(), message, "red"))
    emit_error(message.removeprefix("error: "), exit_code)
    return exit_code


def main() -> None:
    """Entry point of the console script."""
    gc.set_threshold(*_GARBAGE_THRESHOLDS)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # what a terminal has no letter for costs no result
            stream.reconfigure(errors="backslashreplace")
    # Our matrices are small: threads of the linear algebra would only spin, in a wizard for 12 s out of 18.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    act_as_ctrl_c((signal.SIGINT, LAND, CUT, *ENDS))  # outside of a flight, which listens itself
    try:
        code = run(sys.argv[1:])
    except KeyboardInterrupt:  # once more, just when the first was to be told
        code = exit_codes.INTERRUPTED
    for number in known("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2"):
        signal.signal(number, signal.SIG_IGN)  # one more would turn the exit code into a death
    # Whatever the exit code, Python dies of SIGINT where the last text that it ran was interrupted, as by a
    # key that comes while a dataclass is made. This text is not.
    exec("")
    sys.exit(code)
