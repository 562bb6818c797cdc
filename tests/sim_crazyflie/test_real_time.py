"""A lab that should live in real time says when it does not."""

import asyncio
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from onboard.lab_time.messages import encode
from perchhw.cli.main import run
from sim_backend.lab import LabServer, LabSettings
from sim_backend.real_time import WARN_BELOW, WARN_PERIOD_S, WINDOW_S, RealTimeFactor
from tests.lab_file.labs import LAB
from tests.patience import PATIENCE_S, StandingClock

STEP_S = 0.0625


class Watched:
    """A lab that goes on at some rate, and what was told of it when."""

    def __init__(self) -> None:
        self.clock = StandingClock()
        self.factor = RealTimeFactor(self.clock)
        self.lab_time = 0.0
        self.told: list[tuple[float, str]] = []

    def live(self, seconds: float, rate: float) -> None:
        """So long, at `rate`."""
        for _ in range(round(seconds / STEP_S)):
            self.clock.now += STEP_S
            self.lab_time += rate * STEP_S
            warning = self.factor.watch(self.lab_time)
            if warning is not None:
                self.told.append((self.clock.now, warning))


def test_nothing_is_known_in_the_first_second() -> None:
    watched = Watched()
    watched.live(WINDOW_S, 0.5)
    assert watched.factor.recent is None
    assert not watched.told
    watched.live(STEP_S, 0.5)
    assert watched.factor.recent == pytest.approx(0.5)


@pytest.mark.parametrize(("rate", "tells"), [(1.0, False), (0.985, False), (0.975, True), (0.3, True)])
def test_it_warns_below_098_of_real_time(rate: float, tells: bool) -> None:
    assert WARN_BELOW == 0.98
    watched = Watched()
    watched.live(4.0, rate)
    assert watched.factor.recent == pytest.approx(rate)
    assert bool(watched.told) is tells
    assert all(f"at {rate:.2f} of real time" in text for _, text in watched.told)


def test_the_factor_is_that_of_the_last_second() -> None:
    watched = Watched()
    watched.live(10.0, 1.0)
    watched.live(0.5, 0.0)
    assert watched.factor.recent == pytest.approx(0.5, abs=STEP_S)
    watched.live(0.5, 0.0)
    assert watched.factor.recent == pytest.approx(0.0, abs=STEP_S)
    watched.live(WINDOW_S + STEP_S, 1.0)
    assert watched.factor.recent == pytest.approx(1.0)


def test_it_warns_every_five_seconds_at_most() -> None:
    watched = Watched()
    watched.live(16.5, 0.5)
    times = [time for time, _ in watched.told]
    assert len(times) == 4
    assert [later - earlier for earlier, later in pairwise(times)] == [WARN_PERIOD_S] * 3


@pytest.mark.parametrize("slow", [True, False])
def test_a_lab_that_is_too_slow_says_so_on_stderr_and_in_its_figures(
    slow: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = asyncio.run(_live(0.2 if slow else 0.004))
    assert ("this machine is too busy" in capsys.readouterr().err) is slow
    assert figures is not None
    assert figures < 0.5 if slow else figures > WARN_BELOW


@pytest.mark.parametrize(
    ("factor", "tells"), [(None, False), (1.0, False), (0.981, False), (0.979, True), (0.4, True)]
)
def test_the_status_of_a_lab_that_is_too_slow_warns_in_one_line(
    factor: float | None, tells: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = {"answer": "status", "t": 2.0, "real_time_factor": factor}
    with answering(figures) as port:
        lab = tmp_path / "lab.toml"
        level = LAB.replace(", tilt_x_deg = 1.0", "")
        lab.write_text(level.replace("[room]", f'clock = "127.0.0.1:{port}"\n[room]', 1))
        assert run(["--json", "sim", "status", "--lab", str(lab)]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["real_time_factor"] == factor
    lines = told.err.splitlines()
    assert len(lines) == tells
    assert all(f"the lab runs at {factor:.2f} of real time" in line for line in lines)


@contextmanager
def answering(figures: dict[str, Any]) -> Iterator[int]:
    """A lab's clock that says this of itself to the first who asks; the port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)

        def answer() -> None:
            connection, _ = server.accept()
            with connection, connection.makefile("rb") as asked:
                asked.readline()
                connection.sendall(encode(figures))

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        yield server.getsockname()[1]
        thread.join()


async def _live(look_s: float) -> float | None:
    """The real-time factor of a lab every look of which at its clock comes `look_s` after the last."""
    stop, end = asyncio.Event(), 3.0

    class Late(StandingClock):
        """Ends the lab, too."""

        def __call__(self) -> float:
            self.now += look_s
            if self.now > end:
                stop.set()
            return self.now

    lab = LabServer(LabSettings(drone_port=0, with_room=False, parked=True), Late())
    lab.load()
    await lab.start()
    try:
        await lab.run(stop)
        factor: float | None = lab.figures()["real_time_factor"]
    finally:
        await lab.close()
    return factor
