"""The reader thread of a device that talks by itself, and what happens when it is unplugged."""

import threading
from collections.abc import Callable

from calibration.bench.instruments.errors import InstrumentError, InstrumentLost, InstrumentNotFound
from calibration.bench.instruments.transport import Address, SerialPort
from onboard.clock import Clock

#: How often the thread looks whether it should end, when nothing arrives [s].
_LOOK_S = 0.1

Reconnect = Callable[[InstrumentLost], str | None]
"""Called on the reader's thread when the device is gone: waits until it is back and gives its address, which
may be a new one, or None to give up. Called again when that address does not open."""


class PortReader:
    """Reads a port until it is stopped. One thread.

    Attributes:
        reopened: times that the device came back.
        away: it is gone, and `reconnect` is waiting for it.
    """

    def __init__(
        self,
        port: SerialPort,
        on_bytes: Callable[[bytes, float], None],
        on_reopened: Callable[[], None],
        on_end: Callable[[InstrumentError], None],
        *,
        clock: Clock,
        reconnect: Reconnect | None = None,
    ) -> None:
        """Prepare; :meth:`start` starts.

        Args:
            port: open port; it belongs to the reader from now on.
            on_bytes: gets what arrived and when [s]; all three callbacks run on the reader's thread.
            on_reopened: the device is back, perhaps under another name and after a reset.
            on_end: the device is gone for good.
            clock: host clock [s].
            reconnect: None gives up at once.
        """
        self.reopened = 0
        self.away = False
        self._port = port
        self._on_bytes = on_bytes
        self._on_reopened = on_reopened
        self._on_end = on_end
        self._clock = clock
        self._reconnect = reconnect
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"Reader {port.address.device}", daemon=True)

    def start(self) -> None:
        """Start reading."""
        self._thread.start()

    def write(self, data: bytes) -> None:
        """Send bytes to the device.

        Raises:
            InstrumentLost: it is gone.
        """
        self._port.write(data)

    def stop(self) -> None:
        """Stop reading and close the port; returns when the thread has ended. Idempotent."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._port.close()

    @property
    def device(self) -> str:
        """Present name of the port."""
        return self._port.address.device

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                data = self._port.read(_LOOK_S)
                if data:
                    self._on_bytes(data, self._clock())
            except InstrumentLost as error:
                if not self._recover(error):
                    return

    def _recover(self, loss: InstrumentLost) -> bool:
        """Open the device again; False when that is not wanted or not possible."""
        self._port.close()
        self.away = True
        ending: InstrumentError = loss
        while self._reconnect is not None and not self._stopping.is_set():
            try:
                address = self._reconnect(loss)
                if address is None:
                    break
                self._port = SerialPort(Address.parse(address, self._port.address.baud))
                self._on_reopened()
            except (InstrumentNotFound, InstrumentLost) as error:
                loss = InstrumentLost(str(error))
            except InstrumentError as error:
                ending = error
                break
            else:
                self.reopened += 1
                self.away = False
                return True
        if not self._stopping.is_set():
            self._on_end(ending)
        return False
