"""``perchhw sim``: serves the simulated lab, drones alone, the mocap room or the bench until interrupted."""

import asyncio
import contextlib
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import typer

from perchhw.cli import exit_codes
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.options import Lab
from perchhw.cli.output import emit
from perchhw.cli.sim_options import (
    BenchPace,
    DroneOptions,
    DronePort,
    Drones,
    LabFileOut,
    ViconPort,
    ViconUdpPort,
    WithParent,
    WorldOptions,
)
from perchhw.operator_signals import ENDS
from sim_backend.faults import fault_table

if TYPE_CHECKING:
    from sim_backend.lab import LabSettings


class Served(Protocol):
    """What this module serves: a lab or a bench."""

    def prepare(self) -> None:
        """Read and compile; needs no event loop."""
        ...

    async def start(self) -> None:
        """Make everything accept connections."""
        ...

    def ready(self) -> dict[str, Any]:
        """The ready line."""
        ...

    async def run(self, stop: asyncio.Event) -> None:
        """Live until `stop` is set."""
        ...

    async def close(self) -> None:
        """Close everything."""
        ...


app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help="The simulated lab. Prints one JSON line on stdout when everything accepts connections.",
)


@app.command()
@with_option_groups
def lab(
    of_drones: DroneOptions,
    vicon_port: ViconPort = 18801,
    vicon_udp_port: ViconUdpPort = 51001,
    lab_file: LabFileOut = None,
    with_parent: WithParent = False,
) -> int:
    """Drones and mocap room."""
    settings = of_drones.settings(vicon_port=vicon_port, vicon_udp_port=vicon_udp_port, lab_file=lab_file)
    return _serve_lab(settings, with_parent)


@app.command()
@with_option_groups
def drone(of_drones: DroneOptions, with_parent: WithParent = False) -> int:
    """Drones without a mocap room: nobody tells them where they are."""
    return _serve_lab(of_drones.settings(with_room=False), with_parent)


@app.command()
@with_option_groups
def room(
    of_world: WorldOptions,
    drones: Drones = 1,
    vicon_port: ViconPort = 18801,
    vicon_udp_port: ViconUdpPort = 51001,
    with_parent: WithParent = False,
) -> int:
    """The mocap room alone, with drones that rest on their start marks."""
    from sim_backend.lab import LabSettings

    settings = LabSettings(
        drones=drones,
        with_drones=False,
        vicon_port=vicon_port,
        vicon_udp_port=vicon_udp_port,
        **of_world.world_settings(),
    )
    return _serve_lab(settings, with_parent)


@app.command()
@with_option_groups
def bench(
    of_world: WorldOptions,
    drone_port: DronePort = 19850,
    pace: BenchPace = 1.0,
    with_parent: WithParent = False,
) -> int:
    """Strings, tachometer, scale and supply for one drone, and somebody who works them when asked."""
    from sim_backend.bench.serve import BenchSettings, ServedBench

    settings = BenchSettings(drone_port=drone_port, pace=pace, **of_world.world_settings())
    return _serve(ServedBench(settings), with_parent)


@app.command()
def status(lab: Lab = None) -> int:
    """Say what time it is in a simulated lab, how fast that goes, and who takes part in it."""
    from onboard.lab_time.figures import lab_figures
    from perchhw.lab import clock_of
    from sim_backend.real_time import too_slow

    figures = lab_figures(clock_of(lab))
    warning = too_slow(figures["real_time_factor"])
    if warning is not None:
        sys.stderr.write(f"{warning}\n")
    emit(figures, "\n".join(f"{name}: {value}" for name, value in figures.items()))
    return exit_codes.DONE


@app.command()
def faults() -> None:
    """List the faults that --fault can show."""
    table = fault_table()
    emit({"faults": table}, "\n".join(f"{name}={text}" for name, text in table.items()))


def _serve_lab(settings: "LabSettings", with_parent: bool) -> int:
    from sim_backend.lab import LabServer

    return _serve(LabServer(settings), with_parent)


def _serve(lab: Served, with_parent: bool) -> int:
    """Serve until SIGINT (exit code 130), SIGTERM, the end of the terminal or, `with_parent`, of standard
    input (0).
    """
    told = [signal.SIGINT, *(number for number in ENDS if signal.getsignal(number) is not signal.SIG_IGN)]
    # Compiled callbacks swallow a KeyboardInterrupt; nothing is open yet that would have to be closed.
    previous = {
        number: signal.signal(number, lambda number, _frame: os._exit(_exit_code([number])))
        for number in told
    }
    try:
        lab.prepare()
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    return asyncio.run(_serve_until_told(lab, told, with_parent))


def _exit_code(caught: Sequence[int]) -> int:
    return exit_codes.INTERRUPTED if signal.SIGINT in caught else exit_codes.DONE


async def _serve_until_told(lab: Served, told: Sequence[signal.Signals], with_parent: bool) -> int:
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    caught: list[int] = []
    starting = asyncio.create_task(lab.start())

    def end(*number: int) -> None:
        caught.extend(number)
        stop.set()
        starting.cancel()

    for number in told:
        loop.add_signal_handler(number, end, number)
    if with_parent:
        threading.Thread(target=_wait_for_parent, args=(loop, end), daemon=True).start()
    try:
        with contextlib.suppress(asyncio.CancelledError):
            await starting
        if not stop.is_set():
            sys.stdout.write(json.dumps(lab.ready()) + "\n")
            sys.stdout.flush()
            await lab.run(stop)
    finally:
        await lab.close()
    return _exit_code(caught)


def _wait_for_parent(loop: asyncio.AbstractEventLoop, end: Callable[[], None]) -> None:
    """End the lab when standard input does. A thread, because not every kind of input can be polled."""
    while os.read(sys.stdin.fileno(), 4096):  # not through sys.stdin: Python's end would wait for its lock
        pass
    with contextlib.suppress(RuntimeError):  # the lab has ended by itself
        loop.call_soon_threadsafe(end)
