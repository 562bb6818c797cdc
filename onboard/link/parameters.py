"""Parameters, CRTP port 2: read from the drone each time, written until the drone echoes.

Channel 1 read: ``id u16`` -> ``id u16, 0, value``. Channel 2 write: ``id u16, value`` -> the same bytes.
Little endian.
"""

import struct

from cflib.crtp.crtpstack import CRTPPort

from onboard.link.errors import CommandRefused
from onboard.link.exchange import Exchange
from onboard.link.variables import DroneVariable, find

_READ, _WRITE = 1, 2


class Parameters:
    """Reads and writes parameters."""

    def __init__(self, exchange: Exchange, table: dict[str, DroneVariable], reply_timeout_s: float) -> None:
        self._exchange = exchange
        self._table = table
        self._within = reply_timeout_s

    def __contains__(self, name: str) -> bool:
        return name in self._table

    def read(self, name: str) -> float | int:
        """The value that the drone has now.

        Raises:
            NoSuchVariable, CommandRefused, LinkTimeout, LinkLost.
        """
        variable = find(self._table, name, "parameter")
        ident = struct.pack("<H", variable.ident)
        reply, _ = self._exchange.ask(
            CRTPPort.PARAM,
            _READ,
            ident,
            accepts=lambda data: data[:2] == ident,
            within=self._within,
            what=f"read {name}",
        )
        status, value = reply[2], reply[3:]
        if status != 0 or len(value) != variable.size:
            raise CommandRefused(f"the drone refuses to read {name}: status {status}, {len(value)} bytes")
        return variable.unpack(value)

    def write(self, name: str, value: float, retry_s: float | None = None) -> None:
        """Set the value; returns when the drone has echoed exactly it. `retry_s` as of :meth:`Exchange.ask`.

        An echo of another value answers an earlier write that was sent twice or given up: the firmware echoes
        what it was sent (``paramWriteProcess`` in ``param_logic.c``).

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused, LinkTimeout, Superseded, LinkLost.
        """
        variable = find(self._table, name, "parameter")
        if variable.read_only:
            raise CommandRefused(f"{name} is read-only on the drone")
        ident = struct.pack("<H", variable.ident)
        request = ident + variable.pack(value)
        self._exchange.ask(
            CRTPPort.PARAM,
            _WRITE,
            request,
            accepts=lambda data: data == request,
            within=self._within,
            what=f"set {name} = {value}",
            retry_s=retry_s,
            place=ident,
        )
