"""A process of its own that holds the supply's port, and cuts the supply when the wizard dies or hangs.

Motors that were set through ``motorPowerSet`` run on when the host is killed, so somebody who survives must
hold the switch. A port belongs to whoever opened it: a wizard that hangs (SIGSTOP, a lost computer bus) still
has it, and nobody else could open it. So the wizard never opens it; this process does, and the wizard speaks
to it through a socket pair (:class:`~calibration.bench.instruments.kept_supply.KeptSupply`).

It is started in a session of its own, so that neither Ctrl-C nor the end of the terminal reaches it. It cuts

- at once, when the socket ends without a goodbye: the wizard is dead, however it died;
- when a heart beat stays out for as long as the last one said, usually :data:`HANG_S`;
- when the wizard says so, and when somebody ends the keeper itself.

Two threads: one only watches, the other converses with the supply, so that no answer that is waited for
delays a cut. A cut holds: nothing but "off" is obeyed afterwards.

The wizard's lines are JSON: ``{"id": 3, "do": "set", "with": [3.9, 6.0]}`` (or ``switch``, ``measure``,
``close``), answered by ``{"id": 3, "value": ...}`` or ``{"id": 3, "error": TEXT, "kind": CLASS}``;
``{"do": "beat"}``, ``{"do": "rest"}`` (the heart stops on purpose) and ``{"do": "cut"}`` have no answer.
"""

import contextlib
import json
import queue
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple
from typing import Any

from calibration.bench.instruments.errors import InstrumentError, InstrumentRefused
from calibration.bench.instruments.schemes import SUPPLIES
from calibration.bench.instruments.supply import SerialSupply
from onboard.by_name import imported
from onboard.clock import monotonic

#: A wizard whose heart does not beat for so long hangs [s].
HANG_S = 1.0
#: A supply that does not obey is told again for so long; then only a person can help [s].
CUT_WITHIN_S = 5.0
_AGAIN_S = 0.1
_RECEIVE_BYTES = 4096

Say = Callable[[str], None]


class SupplyKeeper:
    """The keeper of one open supply.

    Args:
        supply: open; its port ends with the process.
        wizard: our end of the socket pair.
        told_to_end: has something to read once somebody wants the keeper to cut and end.
        say: told what was done, in words for the operator.
    """

    def __init__(
        self, supply: SerialSupply, wizard: socket.socket, told_to_end: socket.socket, say: Say
    ) -> None:
        self._hang_s = HANG_S
        self._supply = supply
        self._wizard = wizard
        self._told_to_end = told_to_end
        self._say = say
        self._requests: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._talking = threading.Lock()
        self._cut_because = ""
        self._obeyed = False
        self._goodbye = False
        self._hangs_at: float | None = None

    def run(self) -> None:
        """Serve until the wizard has said goodbye or is dead; the supply is off then."""
        conversation = threading.Thread(target=self._converse, name="conversation", daemon=True)
        conversation.start()
        reason = self._watch()
        if not self._goodbye:
            self._cut(reason)
        self._requests.put(None)
        conversation.join()

    def _watch(self) -> str:
        """Follow the wizard's lines and heart until its end; why it is the end."""
        rest = b""
        while True:
            wait = None if self._hangs_at is None else max(0.0, self._hangs_at - monotonic())
            ready = select.select([self._wizard, self._told_to_end], [], [], wait)[0]
            if self._told_to_end in ready:
                return "the keeper was told to end"
            if not ready:
                self._hangs_at = None
                self._cut(f"the wizard hangs (no heart beat for {self._hang_s:g} s)")
                continue
            try:
                data = self._wizard.recv(_RECEIVE_BYTES)
            except ConnectionResetError:
                data = b""
            if not data:
                return "the wizard is dead"
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                self._take(json.loads(line))

    def _take(self, message: dict[str, Any]) -> None:
        what = message["do"]
        if what == "beat":
            self._hang_s = float(message["within"])
            self._hangs_at = None if self._cut_because else monotonic() + self._hang_s
        elif what == "rest":
            self._hangs_at = None
        elif what == "cut":
            self._cut("the wizard said so")
        else:
            self._requests.put(message)

    def _cut(self, reason: str) -> None:
        """Off: at once, and then, when the exchange under way has ended, with a look whether it obeyed."""
        if self._obeyed:
            return
        self._cut_because = reason
        self._hangs_at = None
        device = self._supply.device
        gives_up = monotonic() + CUT_WITHIN_S
        while True:
            try:
                self._supply.cut()
                with self._talking:
                    self._supply.switch(on=False)
            except InstrumentError as error:
                if monotonic() > gives_up:
                    self._say(
                        f"SWITCH THE SUPPLY OFF BY HAND: {reason}, and {device} does not obey ({error})"
                    )
                    return
                time.sleep(_AGAIN_S)
            else:
                self._obeyed = True
                self._say(f"the supply at {device} was switched off: {reason}")
                return

    def _converse(self) -> None:
        """Carry out requests, one after the other."""
        while (request := self._requests.get()) is not None:
            answer = {"id": request["id"], **self._carry_out(request["do"], request["with"])}
            with contextlib.suppress(OSError):  # a wizard that is gone is the watch's business
                self._wizard.sendall(json.dumps(answer).encode() + b"\n")

    def _carry_out(self, what: str, arguments: Sequence[Any]) -> dict[str, Any]:
        with self._talking:
            try:
                return {"value": self._do(what, arguments)}
            except InstrumentError as error:
                return {"error": str(error), "kind": type(error).__name__}

    def _do(self, what: str, arguments: Sequence[Any]) -> Any:
        off = what == "close" or (what == "switch" and not arguments[0])
        if self._cut_because and not off:
            raise InstrumentRefused(
                f"the supply at {self._supply.device} was cut ({self._cut_because}) and stays off; "
                "start the command again"
            )
        if off:
            self._supply.switch(on=False)
            self._goodbye = what == "close"
            return None
        if what == "switch":
            return self._supply.switch(on=True)
        if what == "set":
            return self._supply.set(*arguments)
        return astuple(self._supply.measure())


def _say_on_stderr(text: str) -> None:
    with contextlib.suppress(OSError):  # the terminal may have gone with the wizard
        sys.stderr.write(f"supply keeper: {text}\n")
        sys.stderr.flush()


@contextlib.contextmanager
def _ended_by_sigterm() -> Iterator[socket.socket]:
    """A socket that has something to read once the process got SIGTERM.

    An exception out of the signal's handler could be lost: a signal that comes just before the wait begins
    does not end it. A byte waits.
    """
    told, teller = socket.socketpair()
    with told, teller:
        teller.setblocking(False)
        signal.set_wakeup_fd(teller.fileno(), warn_on_full_buffer=False)
        signal.signal(signal.SIGTERM, lambda _number, _frame: None)
        try:
            yield told
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            signal.set_wakeup_fd(-1)


def main(arguments: Sequence[str]) -> int:
    """``python -m calibration.bench.instruments.supply_keeper KIND ADDRESS FD``, as ``KeptSupply`` does."""
    kind, address, descriptor = arguments
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with _ended_by_sigterm() as told_to_end, socket.socket(fileno=int(descriptor)) as wizard:
        try:
            supply: SerialSupply = imported(SUPPLIES[kind].opener)(address)
        except InstrumentError as error:
            told = {"id": 0, "error": str(error), "kind": type(error).__name__}
            wizard.sendall(json.dumps(told).encode() + b"\n")
            return 1
        opened = {"id": 0, "value": [supply.device, supply.identity]}
        wizard.sendall(json.dumps(opened).encode() + b"\n")
        SupplyKeeper(supply, wizard, told_to_end, _say_on_stderr).run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
