"""Where a host is, in numbers: looked up within a bound, for the system may take half a minute to say no."""

import queue
import socket
import threading
from collections.abc import Callable

LOOK_UP_S = 3.0
"""How long the name of a host may take to be looked up. One in numbers takes no time."""

LookUp = Callable[[str], str]
"""From the name of a host to its address in numbers; OSError where it is not known."""


def host_in_numbers(host: str, look_up: LookUp = socket.gethostbyname) -> str:
    """The IPv4 address of `host`, by a thread that is left behind when it takes too long.

    Raises:
        OSError: it is not known, or not within 3 s.
    """
    found: queue.SimpleQueue[str | OSError] = queue.SimpleQueue()

    def find() -> None:
        try:
            found.put(look_up(host))
        except UnicodeError:
            found.put(OSError(f"{host} cannot be the name of a host"))
        except OSError as error:
            found.put(error)

    threading.Thread(target=find, name="LookUp", daemon=True).start()
    try:
        address = found.get(timeout=LOOK_UP_S)
    except queue.Empty:
        raise OSError(
            f"nobody says within {LOOK_UP_S:g} s where {host} is: give its address in numbers"
        ) from None
    if isinstance(address, OSError):
        raise address
    return address
