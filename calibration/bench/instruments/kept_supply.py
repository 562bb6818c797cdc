"""A supply as the wizard sees it: a process that outlives the wizard holds its port, and cuts it then."""

import contextlib
import itertools
import json
import select
import socket
import subprocess
import sys
import threading
from typing import Any

from calibration.bench.instruments import errors
from calibration.bench.instruments.errors import InstrumentError, InstrumentLost, InstrumentTimeout
from calibration.bench.instruments.supply import OFF_BY_HAND, SCPI_BAUD, OffWhenClosed, SupplyReading
from calibration.bench.instruments.supply_keeper import HANG_S
from calibration.bench.instruments.transport import Address
from onboard.clock import monotonic

#: The keeper has to start, also on a busy machine, before it asks the supply who it is [s].
START_WITHIN_S = 30.0
#: More than the answers of the longest exchange with a supply, each of which may come just in time.
ANSWERS_MAX = 6
#: A keeper that takes no more of our lines is as good as gone [s].
SEND_WITHIN_S = 0.2
_RECEIVE_BYTES = 4096


class KeptSupply(OffWhenClosed):
    """A :class:`~calibration.bench.instruments.supply.Supply` and a
    :class:`~calibration.bench.instruments.motor_stand.RemoteCut`; a context manager.

    Calls from any thread; :meth:`cut` and :meth:`beat` do not wait for one that is under way.

    Attributes:
        device: name of the port.
        identity: what the supply says it is.
        keeper: process id of the keeper.
    """

    typed = False

    def __init__(self, address: str, kind: str = "scpi") -> None:
        """Start the keeper, which opens the port.

        Args:
            address: as :meth:`~calibration.bench.instruments.transport.Address.parse` reads it.
            kind: scheme of :data:`~calibration.bench.instruments.schemes.SUPPLIES`.

        Raises:
            InstrumentInputError, InstrumentNotFound, InstrumentTimeout, WrongBaudRate, WrongDevice: of the
                supply. InstrumentLost: the keeper did not start.
        """
        self._answer_within = ANSWERS_MAX * Address.parse(address, SCPI_BAUD).answer_s
        self._socket, theirs = socket.socketpair()
        self._socket.settimeout(SEND_WITHIN_S)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __package__ + ".supply_keeper", kind, address, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,  # out of reach of Ctrl-C and of the terminal's end
            )
        self.keeper = self._process.pid
        self._numbers = itertools.count(1)
        self._rest = b""
        self._sending, self._asking = threading.Lock(), threading.Lock()
        try:
            self.device, self.identity = self._reply(0, START_WITHIN_S + self._answer_within)
        except BaseException:
            self._let_go()
            raise

    def set(self, voltage: float, current_limit: float) -> None:
        """Set voltage [V] and current limit [A]; errors as the supply's own, or InstrumentLost."""
        self._ask("set", voltage, current_limit)

    def switch(self, on: bool) -> None:
        """Switch the output.

        Raises:
            InstrumentRefused: after a cut it stays off. Else as :meth:`set`.
        """
        self._ask("switch", on)

    def measure(self) -> SupplyReading:
        """Measure at the terminals; errors as :meth:`set`."""
        return SupplyReading(*self._ask("measure"))

    def cut(self) -> None:
        """Off, before anything that waits; returns when the supply is known to be off.

        Raises:
            InstrumentError: it is not: do it by hand.
        """
        self._send({"do": "cut"})
        self.switch(on=False)

    def beat(self, within_s: float = HANG_S) -> None:
        """The heart beat: from the first on, `within_s` s without another cut the supply.

        Raises:
            InstrumentLost: the keeper is gone, so that nobody would.
        """
        self._send({"do": "beat", "within": within_s})

    def rest(self) -> None:
        """No motor turns any more: the heart may stop. Errors as :meth:`beat`."""
        self._send({"do": "rest"})

    def _last_switch_off(self) -> None:
        self._ask("close")

    def _ask(self, what: str, *arguments: float) -> Any:
        with self._asking:
            number = next(self._numbers)
            self._send({"id": number, "do": what, "with": arguments})
            return self._reply(number, self._answer_within)

    def _send(self, message: dict[str, Any]) -> None:
        try:
            with self._sending:
                self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError as error:
            raise self._gone() from error

    def _reply(self, number: int, within_s: float) -> Any:
        """The answer with this number; older ones, that nobody waited for, are left behind."""
        deadline = monotonic() + within_s
        while True:
            answer = json.loads(self._line(deadline, within_s))
            if answer["id"] != number:
                continue
            if "error" in answer:
                raise _as_told(answer)
            return answer["value"]

    def _line(self, deadline: float, within_s: float) -> bytes:
        while b"\n" not in self._rest:
            if not select.select([self._socket], [], [], max(0.0, deadline - monotonic()))[0]:
                raise InstrumentTimeout(
                    f"the keeper of the supply (process {self.keeper}) is silent for {within_s:g} s: "
                    f"{OFF_BY_HAND}"
                )
            try:
                data = self._socket.recv(_RECEIVE_BYTES)
            except OSError as error:
                raise self._gone() from error
            if not data:
                raise self._gone()
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\n")
        return line

    def _gone(self) -> InstrumentLost:
        return InstrumentLost(f"the keeper of the supply (process {self.keeper}) is gone: {OFF_BY_HAND}")

    def _let_go(self) -> None:
        """Without a goodbye before, the keeper switches off now, and may take a while."""
        self._socket.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(self._answer_within)


def _as_told(answer: dict[str, Any]) -> InstrumentError:
    """The keeper's error as the class that it was there."""
    kind = getattr(errors, answer["kind"])
    error: InstrumentError = kind(answer["error"])
    return error
