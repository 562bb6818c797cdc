"""Where a lab keeps its time, as its URIs say: ``?time=HOST:PORT``."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from onboard.lab_time.lab_time import LabTime, LabTimeError
from onboard.timebase import WALL, Timebase

OPTION = "time"
_LAST_PORT = 65_535


class TimeAddress(NamedTuple):
    """Host and TCP port of a lab's clock."""

    host: str
    port: int


def time_address(uri: str) -> TimeAddress | None:
    """The clock that `uri` names, or None: real time.

    Raises:
        LabTimeError: what it names is no address.
    """
    try:
        values = parse_qs(urlsplit(uri).query).get(OPTION)
    except ValueError as error:  # a bracket that is left open
        raise LabTimeError(f"{uri!r} is no usable address ({error}); correct it") from error
    if not values:
        return None
    host, _, port = values[0].rpartition(":")
    if not host or not port.isdecimal() or int(port) > _LAST_PORT:
        raise LabTimeError(f"{uri!r}: {OPTION}={values[0]} is no address; write {OPTION}=HOST:PORT")
    return TimeAddress(host, int(port))


@contextmanager
def open_timebase(name: str, *uris: str) -> Iterator[Timebase]:
    """The time of whoever answers at `uris`: that of their lab, or real time.

    Args:
        name: who takes part, for the lab's messages.
        uris: of drones and mocap streams.

    Raises:
        LabTimeError: they name two clocks, or one that does not answer.
    """
    addresses = {address for uri in uris if (address := time_address(uri)) is not None}
    if not addresses:
        yield WALL
        return
    if len(addresses) > 1:
        raise LabTimeError(f"these are of different labs, with a time each: {' and '.join(uris)}")
    address = addresses.pop()
    with LabTime(address.host, address.port, name) as lab_time:
        yield lab_time
