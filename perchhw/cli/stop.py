"""``perchhw stop``: cut the motors, from any terminal, beside whoever flies."""

import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict
from pathlib import Path
from threading import Thread
from types import FrameType
from typing import Annotated, Any

import typer

from onboard.errors import InputError, PerchhwError
from onboard.link.errors import LinkInputError
from onboard.link.exclusive import drones_in_use
from onboard.link.stop import StopReport
from onboard.link.stop_drone import stop_drone
from onboard.link.stop_note import note_stop
from onboard.link.uri import stop_command
from perchhw.cli import exit_codes
from perchhw.cli.environment import DRONE_VARIABLE, LAB_VARIABLE
from perchhw.cli.output import emit, written
from perchhw.operator_signals import known

NOTED_WITHIN_S = 5.0
"""How long the end of the command waits for the note that it leaves to those who fly."""

_SAID_EVERY_S = 1.0
Stopped = tuple[dict[str, Any], int]
"""What came of a stop, and its exit code."""

_SIGNALS = known("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGUSR2")

app = typer.Typer(add_completion=False)


@app.command()
def stop(
    drones: Annotated[
        list[str] | None, typer.Argument(metavar="[URI]...", help="As --drone, for who is in a hurry.")
    ] = None,
    drone: Annotated[
        list[str] | None,
        typer.Option(help="URI of the drone; may be repeated. Goes before --lab."),
    ] = None,
    lab: Annotated[
        Path | None,
        typer.Option(
            envvar=LAB_VARIABLE, help="Lab file whose drones are all stopped. Default: lab.toml, here."
        ),
    ] = None,
) -> int:
    """Cut the motors of drones now, and repeat it until each says that it is locked (until it is rebooted).

    It has a connection of its own, waits for no lock, and does not ask: a drone in the air falls. Once begun
    it goes on to its end, some seconds at most, and says what came of it, also when it is interrupted.

    Exit codes: 0 all are locked, 1 not confirmed (also where a damaged lab file may name more drones than
    were found in it), 2 no drone was named, or not in a way that can be used.
    """
    with _not_called_off():
        uris, doubt = drones_to_stop([*(drones or []), *(drone or [])], lab)
        with ThreadPoolExecutor(len(uris)) as threads:
            stops = {uri: threads.submit(_stopped, uri) for uri in uris}
            _wait_aloud(stops)
            results = [stop.result() for stop in stops.values()]
        document: dict[str, Any] = {"drones": [stopped for stopped, _ in results]}
        codes = [code for _, code in results]
        if doubt:
            document["doubt"] = doubt
            codes.append(exit_codes.FAILED)
            _say_beside(doubt)
        _tell(document, "\n".join(_in_words(stopped) for stopped, _ in results))
    return max(codes)


def drones_to_stop(drone: Sequence[str], lab: Path | None) -> tuple[list[str], str]:
    """The URIs that were given, or else those of the lab file: the one given, or that of this folder; with
    them that of the environment. And why they are not sure to be all, else an empty text.

    Raises:
        LinkInputError: neither is there.
        LabFileError: the lab file names no drones, nor does the environment.
    """
    if drone:
        return list(dict.fromkeys(drone)), ""
    from onboard.lab_file import LAB_FILE, LabFileError, drone_addresses

    usual = [uri] if (uri := os.environ.get(DRONE_VARIABLE)) else []
    if lab is None and not LAB_FILE.exists():
        if usual:
            return usual, ""
        flown = "".join(f"; in use on this machine: {stop_command(uri)}" for uri in drones_in_use())
        raise LinkInputError(
            f"no drone to stop: give --drone URI, or --lab FILE (here is no {LAB_FILE}){flown}"
        )
    try:
        found = drone_addresses(lab or LAB_FILE)
    except LabFileError as problem:
        if not usual:
            raise
        return usual, f"{problem}; stopped was the drone of {DRONE_VARIABLE} alone"
    doubt = f"{found.doubt}; stopped was what looks like a drone's address in it" if found.doubt else ""
    return list(dict.fromkeys([*found.uris, *usual])), doubt


def _stopped(uri: str) -> Stopped:
    """What came of one stop, and its exit code. One drone out of reach does not keep the others flying."""
    noted = _Note(uri)
    try:
        report = stop_drone(uri)
        code = exit_codes.DONE if report.locked else exit_codes.FAILED
    except Exception as error:  # noqa: BLE001 -- whatever it is: the verdicts of the others must be told
        reason = str(error) if isinstance(error, PerchhwError) else f"error in perchhw: {error!r}"
        report = StopReport(locked=False, reason=reason, seconds=0.0, copies=0)
        code = exit_codes.USAGE if isinstance(error, InputError) else exit_codes.FAILED
    return {"drone": uri, **asdict(report), "noted": noted.written()}, code


def _wait_aloud(stops: dict[str, Future[Stopped]]) -> None:
    """Wait for their ends; who is not confirmed yet is said every second."""
    while left := wait(stops.values(), _SAID_EVERY_S).not_done:
        for uri in (uri for uri, stop in stops.items() if stop in left):
            _say_beside(f"{uri}: still stopping, not confirmed yet: keep away")


class _Note:
    """Notes the stop of a drone on a thread of its own: a disk that hangs must not hold up the stop."""

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self._written = False
        self._thread = Thread(target=self._write, daemon=True)
        self._thread.start()

    def written(self) -> bool:
        """Whether those who fly on this machine will see it; waits for a slow disk, not for a broken one."""
        self._thread.join(NOTED_WITHIN_S)
        return self._written

    def _write(self) -> None:
        with contextlib.suppress(LinkInputError):  # the stop says it
            self._written = note_stop(self._uri)


def _in_words(result: dict[str, Any]) -> str:
    if result["locked"]:
        note = "" if result["noted"] else "; NOBODY ELSE IS TOLD: a campaign that flies it may take off again"
        return f"{result['drone']}: locked after {1000.0 * result['seconds']:.0f} ms{note}"
    return f"{result['drone']}: NOT CONFIRMED: {result['reason']}"


@contextlib.contextmanager
def _not_called_off() -> Iterator[None]:
    """Ctrl-C, SIGTERM, a terminal that closes and the keys of a flight end nothing: whoever sends these
    signals wants the motors off.
    """

    def goes_on(_number: int, _frame: FrameType | None) -> None:
        if sys.stderr is not None:  # where it is closed, its number may be that of a socket
            with contextlib.suppress(OSError):
                os.write(2, b"still stopping; what came of it follows\n")  # no print: it may interrupt one

    before = {number: signal.signal(number, goes_on) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _tell(document: dict[str, Any], words: str) -> None:
    """Give the verdict; on stderr where nobody reads stdout (any more), which changes nothing about it."""
    heard = False
    with contextlib.suppress(OSError):  # a full disk
        heard = emit(document, words)
    if not heard:
        _say_beside(words)


def _say_beside(words: str) -> None:
    with contextlib.suppress(OSError):  # nobody is left to tell; the exit code says it
        written(sys.stderr, lambda: sys.stderr.write(words + "\n"))
