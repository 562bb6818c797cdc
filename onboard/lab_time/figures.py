"""What a simulated lab says of itself: its time, its pace, who takes part."""

import socket
from typing import Any

from onboard.lab_time.address import TimeAddress
from onboard.lab_time.lab_time import LabTimeError
from onboard.lab_time.messages import decode, encode

WITHIN_S = 5.0


def lab_figures(address: TimeAddress) -> dict[str, Any]:
    """The figures: ``t`` (lab s), ``pace``, ``real_time_factor`` (None unless in real time), ``dropped_s``,
    ``takes_part`` (names).

    Raises:
        LabTimeError: no lab answers there.
    """
    try:
        with (
            socket.create_connection(address, timeout=WITHIN_S) as connection,
            connection.makefile("rb") as lines,
        ):
            connection.sendall(encode({"ask": "status"}))
            figures = decode(lines.readline())
    except (OSError, ValueError) as error:
        raise LabTimeError(
            f"no simulated lab answers at {address.host}:{address.port} ({error}); "
            "is `perchhw sim lab` running?"
        ) from error
    return {name: value for name, value in figures.items() if name != "answer"}
