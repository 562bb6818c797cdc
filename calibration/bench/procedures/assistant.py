"""An assistant behind a socket that does what a wizard asks: ``--hands tcp://HOST:PORT``.

One JSON object a line, one reply a line (docs/bench_instruments.md). The simulated bench has such hands; a
laboratory with a robot or a rig of its own can have them too.
"""

import json
import re
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from calibration.bench.procedures.operator import Gauge, NotConfirmed, Question, Task
from calibration.errors import CalibrationError
from onboard.closing import Closing
from onboard.errors import InputError
from onboard.quantity import convert

_ADDRESS = re.compile(r"^tcp://([^:/]+):(\d+)$")
REPLY_TIMEOUT_S = 120.0
"""Hanging a drone takes a while."""


class AssistantAddressError(CalibrationError, InputError):
    """``--hands`` is not an address."""


class AssistantFailed(CalibrationError):
    """The assistant could not do what it was asked, or is gone."""


class Assistant(Closing):
    """An operator whose hands are at the other end of a socket.

    Args:
        address: ``tcp://HOST:PORT``.
        say: told what happens, for the person who watches.
        confirmed: phrases of safety questions that the person has said in advance (flags).
        timeout_s: how long one request may take, s.

    Raises:
        AssistantAddressError: not an address.
        AssistantFailed: nobody answers there.
    """

    def __init__(
        self,
        address: str,
        say: Callable[[str], None],
        confirmed: Sequence[str] = (),
        timeout_s: float = REPLY_TIMEOUT_S,
    ) -> None:
        match = _ADDRESS.match(address)
        if match is None:
            raise AssistantAddressError(f"--hands {address!r}: write tcp://HOST:PORT")
        self._address = address
        self._say = say
        self._confirmed = tuple(confirmed)
        try:
            self._socket = socket.create_connection((match.group(1), int(match.group(2))), timeout_s)
        except OSError as error:
            raise AssistantFailed(
                f"{address}: nobody answers ({error.strerror}); is the bench running?"
            ) from error
        self._stream = self._socket.makefile("rwb")

    def close(self) -> None:
        """Let go."""
        self._stream.close()
        self._socket.close()

    def begin(self, title: str, number: int) -> None:
        """Say which step begins."""
        self._say(f"{number:2d}  {title}")

    def tell(self, text: str) -> None:
        """Pass on."""
        self._say(f"    {text}")

    def warn(self, text: str) -> None:
        """Pass on."""
        self._say(f"  ! {text}")

    def do(self, task: Task) -> dict[str, Any]:
        """Have it done."""
        return self.request({"do": task.action, **task.parameters})

    def measure(self, question: Question) -> list[float]:
        """Have it measured, as often as wanted."""
        readings = []
        for _ in range(question.readings):
            reply = self.request({"ask": question.name})
            readings.append(convert(float(reply["value"]), str(reply["unit"]), question.unit))
        return readings

    def confirm(self, sentence: str, phrase: str) -> None:
        """An assistant does not answer for a person: the flag must have."""
        if phrase not in self._confirmed:
            raise NotConfirmed(f"{sentence} Say so with --confirm {phrase!r}")

    def agree(self, question: str) -> bool:
        """Yes: what is asked here can be undone."""
        self._say(f"    {question} yes")
        return True

    @contextmanager
    def live(self, title: str) -> Iterator[Callable[[Sequence[Gauge]], None]]:
        """Nobody looks."""
        yield lambda gauges: None

    def request(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """One request of the protocol and its reply.

        Raises:
            AssistantFailed: it cannot be done, or nobody answers any more.
        """
        try:
            self._stream.write(json.dumps(request).encode() + b"\n")
            self._stream.flush()
            line = self._stream.readline()
        except OSError as error:
            raise AssistantFailed(f"{self._address}: does not answer any more ({error})") from error
        if not line:
            raise AssistantFailed(f"{self._address}: has closed the connection")
        try:
            reply: dict[str, Any] = json.loads(line)
        except ValueError as error:
            raise AssistantFailed(f"{self._address}: said {line!r}, which is not JSON") from error
        if "error" in reply:
            raise AssistantFailed(f"{self._address}: {reply['error']}")
        return reply
