"""The process that holds the supply's port: it serves, and cuts the supply when its wizard dies or hangs.

Wizards here are child processes that are killed or stopped; supplies are on pseudo-terminals.
"""

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator

import pytest

from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentInputError,
    InstrumentLost,
    InstrumentNotFound,
    InstrumentRefused,
)
from calibration.bench.instruments.kept_supply import KeptSupply
from calibration.bench.instruments.supply import ScpiSupply
from calibration.bench.instruments.supply_keeper import HANG_S, SupplyKeeper
from tests.bench_commands.until import until
from tests.instruments.pty_device import PtyDevice
from tests.instruments.test_polled_instruments import TinyKorad, TinyScpi
from tests.patience import PATIENCE_S

WIZARD = """
import sys, threading
from calibration.bench.instruments.kept_supply import KeptSupply
supply = KeptSupply(sys.argv[1], sys.argv[2])
supply.set(3.7, 5.0)
supply.switch(on=True)
supply.beat()
print(supply.keeper, flush=True)
asked = threading.Thread(target=supply.measure, daemon=True)
if "hung" in sys.argv:
    asked.start()
while True:
    supply.beat()
    threading.Event().wait(0.02)
"""
"""Switches a supply on and looks after it for ever; `hung`: with a question that is never answered."""


def is_on(tiny: TinyScpi | TinyKorad) -> bool:
    return tiny.on if isinstance(tiny, TinyScpi) else bool(tiny.status & 0x40)


def exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


class Wizard:
    """A wizard in a process and a session of its own."""

    def __init__(self, port: str, kind: str, *further: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", WIZARD, port, kind, *further],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self.process.stdout is not None
        self.keeper = int(self.process.stdout.readline())

    def end(self) -> str:
        """Make sure that it is over; what it and its keeper said."""
        self.process.kill()
        said = self.process.communicate(timeout=PATIENCE_S)[1]
        until(lambda: not exists(self.keeper), PATIENCE_S)
        return said


@pytest.fixture
def wizard() -> Iterator[Callable[..., Wizard]]:
    started: list[Wizard] = []

    def start(*arguments: str) -> Wizard:
        started.append(Wizard(*arguments))
        return started[-1]

    yield start
    for one in started:
        if one.process.returncode is None:
            one.end()


SUPPLIES = pytest.mark.parametrize(("kind", "tiny"), [("scpi", TinyScpi), ("korad", TinyKorad)])


@SUPPLIES
def test_a_kept_supply_does_what_it_is_told(kind: str, tiny: type[TinyScpi] | type[TinyKorad]) -> None:
    with PtyDevice(tiny()) as device:
        with KeptSupply(device.patient, kind) as supply:
            assert supply.device == device.name
            assert supply.identity in ("ACME,PS1,7,1.0", "KORADKA3005PV2.0")
            supply.set(3.7, 5.0)
            supply.switch(on=True)
            assert is_on(device._answer)  # type: ignore[arg-type]
            assert supply.measure().voltage == 3.7
            with pytest.raises(InstrumentRefused):
                supply.set(31.0, 5.0)
            with pytest.raises(InstrumentInputError):
                supply.set(float("nan"), 5.0)
            supply.beat()
            supply.rest()
        assert not is_on(device._answer)  # type: ignore[arg-type]
        assert not exists(supply.keeper)
        supply.close()


def test_what_does_not_open_is_told_as_by_the_supply_itself() -> None:
    with pytest.raises(InstrumentNotFound, match="there is no port /dev/nowhere"):
        KeptSupply("/dev/nowhere")


@SUPPLIES
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_the_supply_is_off_soon_after_the_wizard_dies_or_hangs(
    wizard: Callable[..., Wizard], kind: str, tiny: type[TinyScpi] | type[TinyKorad], end: signal.Signals
) -> None:
    supply = tiny()
    with PtyDevice(supply) as device:
        running = wizard(device.patient, kind)
        assert is_on(supply)
        running.process.send_signal(end)
        until(lambda: not is_on(supply), PATIENCE_S)
        said = running.end()
    assert ("was switched off: the wizard is dead" in said) is (end is signal.SIGKILL), said
    assert ("was switched off: the wizard hangs" in said) is (end is signal.SIGSTOP), said


@pytest.mark.further
def test_a_question_that_is_never_answered_does_not_delay_the_cut(wizard: Callable[..., Wizard]) -> None:
    supply = TinyScpi()
    heard = threading.Event()

    def mute(data: bytes) -> bytes:
        if data == b"MEAS:VOLT?\n":
            heard.set()
        answer = supply(data)
        return b"" if heard.is_set() else answer

    with PtyDevice(mute) as device:
        running = wizard(device.name, "scpi", "hung")
        assert heard.wait(PATIENCE_S)
        running.process.kill()
        until(lambda: not supply.on, PATIENCE_S)
        assert "SWITCH THE SUPPLY OFF BY HAND" in running.end()
        after_the_question = device.received.partition(b"MEAS:VOLT?\n")[2]
        # Said once without waiting, and once more with a look at what came of it.
        assert after_the_question.startswith(b"OUTP OFF\nOUTP OFF\nSYST:ERR?\n")


def test_the_whole_process_group_is_not_the_keepers(wizard: Callable[..., Wizard]) -> None:
    supply = TinyScpi()
    with PtyDevice(supply) as device:
        running = wizard(device.patient, "scpi")
        for ending in (signal.SIGINT, signal.SIGHUP, signal.SIGKILL):
            os.killpg(running.process.pid, ending)
        until(lambda: not supply.on, PATIENCE_S)
        running.end()


def test_a_word_to_end_that_comes_before_the_keeper_waits_is_not_lost() -> None:
    """A signal's handler may run just before the wait; its word must still end it."""
    tiny, said = TinyScpi(), list[str]()
    with PtyDevice(tiny) as device:
        supply = ScpiSupply(device.patient)
        supply.switch(on=True)
        (ours, wizard), (told, teller) = socket.socketpair(), socket.socketpair()
        with ours, wizard, told, teller:
            teller.send(b"x")
            SupplyKeeper(supply, wizard, told, said.append).run()
        assert not tiny.on
        assert said == [f"the supply at {device.name} was switched off: the keeper was told to end"]
        supply.close()


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_a_keeper_that_dies_is_noticed(end: signal.Signals) -> None:
    tiny = TinyScpi()
    with PtyDevice(tiny) as device:
        supply = KeptSupply(device.patient)
        supply.switch(on=True)
        os.kill(supply.keeper, end)
        supply._process.wait(PATIENCE_S)
        assert tiny.on is (end is signal.SIGKILL)
        for call in (supply.beat, supply.rest, supply.cut, supply.measure):
            with pytest.raises(InstrumentLost, match="SWITCH THE SUPPLY OFF BY HAND"):
                call()
        with pytest.raises(InstrumentError, match="BY HAND"):
            supply.close()


def test_what_was_cut_stays_off_and_says_why() -> None:
    tiny = TinyScpi()
    with PtyDevice(tiny) as device, KeptSupply(device.patient) as supply:
        supply.switch(on=True)
        supply.cut()
        assert not tiny.on
        with pytest.raises(InstrumentRefused, match=r"was cut \(the wizard said so\) and stays off"):
            supply.switch(on=True)
        with pytest.raises(InstrumentRefused, match="was cut"):
            supply.measure()
        assert not tiny.on
        supply.switch(on=False)


def test_a_heart_that_rests_or_has_never_beaten_is_no_hang() -> None:
    tiny = TinyScpi()
    with PtyDevice(tiny) as device, KeptSupply(device.patient) as supply:
        supply.switch(on=True)
        threading.Event().wait(1.2 * HANG_S)
        supply.beat()
        supply.rest()
        threading.Event().wait(1.2 * HANG_S)
        assert supply.measure().limited is False
        assert tiny.on
