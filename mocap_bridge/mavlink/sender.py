"""An endpoint of ours that sends to one address, answers whoever asks, and has a thread for it."""

import threading
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from mocap_bridge.errors import MocapUriError
from mocap_bridge.mavlink.address import MavlinkAddress
from mocap_bridge.mavlink.endpoint import MavlinkEndpoint, ReceivedMessage
from mocap_bridge.mavlink.refusal import Refusals, timesync_answer
from onboard.clock import Clock
from onboard.host_lookup import host_in_numbers

SYSTEM = 1
"""A vehicle's number, which its companions share."""


class MavlinkSender(ABC):
    """A context manager: its thread runs while it is open.

    Args:
        address: where to.
        component: who we are within the system.
        clock: by which is sent.
        name: of the thread.
        ends_within: the longest that the end waits for the thread, s.

    Raises:
        MocapUriError: nobody knows the host.
    """

    def __init__(
        self, address: MavlinkAddress, component: int, clock: Clock, name: str, ends_within: float
    ) -> None:
        self._to = (_in_numbers(address), address.port)
        self._endpoint = MavlinkEndpoint(SYSTEM, component, key=address.key, ipv6=":" in address.host)
        self._clock = clock
        self._refusals = Refusals(SYSTEM)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._ends_within = ends_within

    @abstractmethod
    def _run(self) -> None:
        """The thread, until it is stopping."""

    def _answer(self, received: ReceivedMessage) -> str | None:
        """Answer a request for the time, refuse a command; gives what is to be said about it."""
        refusal, text = self._refusals.answer(received)
        for message in (timesync_answer(received.message, self._clock()), refusal):
            if message is not None:
                self._endpoint.send(message, received.source)
        return text

    @property
    def lost(self) -> int:
        """Messages that found nobody on this computer, or no room."""
        return self._endpoint.lost

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join(self._ends_within)
        self._endpoint.close()


def _in_numbers(address: MavlinkAddress) -> str:
    """Its host, looked up once: the system would do so again for every packet, and wait for the network."""
    if ":" in address.host:
        return address.host  # IPv6 is written in numbers alone
    try:
        return host_in_numbers(address.host)
    except OSError as error:
        raise MocapUriError(
            f"no MAVLink to {address}: {error.strerror or error}; check its name, or give it in numbers"
        ) from error
