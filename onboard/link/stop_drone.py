"""Stop a drone from outside its flight: a socket or radio of one's own, and no connection to wait for."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

from onboard.host_lookup import LookUp, host_in_numbers
from onboard.link.errors import LinkError, LinkInputError
from onboard.link.stop import StopPath, StopPort, StopReport
from onboard.link.stop_ports import UdpStopPort
from onboard.link.uri import check_drone_uri, parse_udp_uri

_SERIAL_LENGTH = 10
"""A radio is named by its number, or by a serial number of at least this many characters."""


def stop_drone(uri: str, look_up: LookUp = socket.gethostbyname) -> StopReport:
    """Cut the motors of the drone at `uri`, whoever flies it; returns when it is locked, or does not answer.

    Over ``radio://`` another radio than the one in the address does as well: the flight may hold that one.

    Args:
        uri: where the drone is.
        look_up: the names of hosts. The system's may wait for half a minute where the network is down.

    Raises:
        LinkInputError: the URI cannot be used.
        LinkError: there is no free radio, or the host is not known, or not within 3 s.
    """
    check_drone_uri(uri)
    opened = _udp_port(uri, look_up) if uri.startswith("udp://") else _cflib_port(uri)
    with opened as port:
        path = StopPath(port)
        path.trigger()
        path.close()
    report = path.report
    if report is None:
        raise LinkError(f"the stop of {uri} ended without a report; cut its power")
    return report


@contextmanager
def _udp_port(uri: str, look_up: LookUp) -> Iterator[StopPort]:
    """Without cflib, which takes its time to load."""
    address = parse_udp_uri(uri)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        try:
            udp.connect((host_in_numbers(address.host, look_up), address.port))
        except OSError as error:
            raise LinkError(f"cannot reach {uri}: {error}; check host and network, cut its power") from error
        yield UdpStopPort(udp)


@contextmanager
def _cflib_port(uri: str) -> Iterator[StopPort]:
    from onboard.link.radio import CflibStopPort

    driver = _open_driver(uri)
    port = CflibStopPort(driver)
    try:
        yield port
    finally:
        port.close()
        driver.close()


def _open_driver(uri: str) -> Any:
    """A driver through the radio in the address, or through any other one that is free."""
    import cflib.crtp

    from onboard.link.driver import install_driver

    install_driver()
    try:
        driver = cflib.crtp.get_link_driver(uri)
    except Exception as error:  # cflib raises bare exceptions here, there is nothing narrower
        other = _next_radio(uri)
        if other is None:
            raise LinkError(f"cannot stop {uri}: {error}; is a radio free?") from error
        return _open_driver(other)
    if driver is None:
        raise LinkInputError(f"no driver for {uri!r}; write udp://HOST:PORT, radio://... or usb://...")
    return driver


def _next_radio(uri: str) -> str | None:
    """The same address through the next radio of this machine, by number; None after the last."""
    from cflib.drivers.crazyradio import get_serials

    radio = urlsplit(uri).netloc
    following = int(radio) + 1 if radio.isdigit() and len(radio) < _SERIAL_LENGTH else 0
    if not uri.startswith("radio://") or following >= len(get_serials()):
        return None
    return uri.replace(f"radio://{radio}", f"radio://{following}", 1)
