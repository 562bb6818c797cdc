"""One shift flown: a lab with its faults, ``perchhw campaign run --resume`` in it, and what befalls them.

What happened is kept beside the lab's truth, as it happens: ``shift.json`` of a shift that nobody ended is
as good as any other.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from onboard.json_file import write_json_atomically
from perchhw.lab_process import SimulatedLab
from tests.faulty_campaign.shift import Blow, Shift, Strike, as_document

ATTEMPTS = "attempts"
LONGEST_S = 300.0
"""For which no run of a shift says nothing new, s: it hangs."""
SPEEDS, ANGLES = (2.2, 2.35, 2.5, 2.65, 2.8), (50, 53, 56, 59, 62)
_LOOK_S = 0.02
_STILL_S = 0.7
"""Real time without a row in which the lab's time stands still, s; it writes one every 0.1 s of its time."""
_REST_WITHIN_S = 8.0
_CAMPAIGN = """
schema = "perchhw.campaign/1"
name = "faulty"
seed = {seed}

[grid]
speeds = {speeds}
angles_deg = {angles}
repeats = {repeats}

[stop]
attempts = {attempts}
aborted_in_a_row = {in_a_row}
"""

_BEGIN = """
import os, resource, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)  # it hears Ctrl-C also where we were started to ignore it
if limit := int(sys.argv[1]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
os.execv(sys.executable, [sys.executable, "-m", "perchhw", *sys.argv[2:]])
"""


class ShiftBook:
    """What happened in a shift, kept in its folder."""

    def __init__(self, folder: Path, shift: Shift, before: list[str]) -> None:
        self._folder = folder
        self._said: dict[str, Any] = {**as_document(shift), "before": before, "struck": []}
        self.note()

    def note(self, **what: Any) -> None:
        """Keep some more of it."""
        self._said |= what
        write_json_atomically(self._folder / "shift.json", self._said)

    def struck(self, strike: Strike, record: Path | None, left: str) -> None:
        """A blow has fallen on the flight of `record`, whose events were `left`."""
        name = None if record is None else record.name
        blow = {"blow": strike.blow.value, "record": name, "phase": strike.phase, "left": left}
        self.note(struck=[*self._said["struck"], blow])


def fly_shift(day: Path, shift: Shift, seed: int, attempts: int) -> None:
    """Fly one shift of the campaign in the folder `day`.

    Args:
        day: holds ``campaign`` and ``shifts``.
        shift: what goes wrong.
        seed, attempts: of the campaign.
    """
    folder, campaign = day / "shifts" / f"{shift.number:04d}", day / "campaign"
    _end_those_cut_off(day, campaign)
    folder.mkdir(parents=True)
    book = ShiftBook(folder, shift, names(campaign))
    file = day / "faulty.toml"
    repeats = -(-attempts // (len(SPEEDS) * len(ANGLES)))
    file.write_text(
        _CAMPAIGN.format(
            seed=seed,
            speeds=list(SPEEDS),
            angles=list(ANGLES),
            repeats=repeats,
            attempts=attempts,
            in_a_row=shift.aborted_in_a_row,
        )
    )
    arguments = (*shift.lab_arguments(seed), "--truth", str(folder / "truth.csv"), "--truth-motors")
    with SimulatedLab("lab", arguments) as lab, (folder / "said.txt").open("w") as said:
        run = ("campaign", "run", str(file), "--lab", lab.ready["lab"], "--out", str(campaign))
        process = subprocess.Popen(
            [sys.executable, "-c", _BEGIN, str(shift.file_limit or 0), "--json", *run, "--yes", "--resume"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=said,
        )
        try:
            hung = not _watch(process, deque(shift.strikes), campaign, set(names(campaign)), lab, book)
        finally:
            process.kill()
            process.wait()
        _wait_until_rest(folder / "truth.csv")
        book.note(hung=hung, exit_code=process.returncode, clock_offset=_offset(shift, folder))
    book.note(records=names(campaign))


def names(campaign: Path) -> list[str]:
    """The records of the campaign, by name."""
    folder = campaign / ATTEMPTS
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


def _end_those_cut_off(day: Path, campaign: Path) -> None:
    """Shifts in which this program itself was killed: what was recorded until now is theirs."""
    for file in sorted((day / "shifts").glob("*/shift.json")):
        said = json.loads(file.read_text())
        if "records" not in said:
            write_json_atomically(file, {**said, "records": names(campaign)})


def _wait_until_rest(truth: Path) -> None:
    """Let the lab go on until its time stands still, as it does when nothing moves, or for some seconds."""
    deadline, size = time.monotonic() + _REST_WITHIN_S, -1
    while time.monotonic() < deadline and size != (now := truth.stat().st_size):
        size = now
        threading.Event().wait(_STILL_S)


def _watch(
    process: "subprocess.Popen[bytes]",
    strikes: deque[Strike],
    campaign: Path,
    before: set[str],
    lab: SimulatedLab,
    book: ShiftBook,
) -> bool:
    """Strike when it is time, until the process has ended; False: it does not end."""
    pause, deadline = threading.Event(), time.monotonic() + LONGEST_S
    told: tuple[int, str] | None = None
    while process.poll() is None:
        if time.monotonic() > deadline:
            return False
        pause.wait(_LOOK_S)
        new = [name for name in names(campaign) if name not in before]
        now = (len(new), _events(campaign / ATTEMPTS / new[-1]) if new else "")
        if now != told:
            told, deadline = now, time.monotonic() + LONGEST_S
        if strikes and (record := _its_turn(strikes[0], campaign / ATTEMPTS, new)) is not None:
            strike = strikes.popleft()
            pause.wait(strike.later)
            book.struck(strike, record, _events(record))
            _strike(strike, process, lab)
    return True


def _its_turn(strike: Strike, attempts: Path, new: list[str]) -> Path | None:
    """The record of the flight that it strikes, once that has come so far, or is over."""
    if len(new) < strike.attempt:
        return None
    record = attempts / new[-1]
    if len(new) > strike.attempt or strike.phase is None:
        return record
    return record if f'"phase": "{strike.phase}"' in _events(record) else None


def _events(record: Path) -> str:
    file = record / "events.jsonl"
    return file.read_text() if file.is_file() else ""


def _strike(strike: Strike, process: "subprocess.Popen[bytes]", lab: SimulatedLab) -> None:
    if strike.blow is Blow.KILLED:
        process.kill()
    elif strike.blow is Blow.INTERRUPTED:
        process.send_signal(signal.SIGINT)
    elif strike.blow is Blow.STOPPED:
        stop = [sys.executable, "-m", "perchhw", "stop", "--drone", lab.drones[0]]
        subprocess.run(stop, capture_output=True, check=False)
    elif strike.blow is Blow.LAB_KILLED:
        os.kill(lab.pid, signal.SIGKILL)
    elif strike.blow is Blow.ROOM_KILLED:
        os.kill(lab.ready["processes"]["room"], signal.SIGKILL)
    else:
        process.send_signal(signal.SIGSTOP)
        threading.Event().wait(strike.seconds)
        process.send_signal(signal.SIGCONT)


def _offset(shift: Shift, folder: Path) -> float:
    """How far a flight's clock is ahead of the lab's time, s."""
    if not shift.at_real_pace:
        return 0.0
    last = (folder / "truth.csv").read_text().splitlines()[-2]  # the last one may be torn
    return time.monotonic() - float(last.split(",")[0])
