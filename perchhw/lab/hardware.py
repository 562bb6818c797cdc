"""On hardware no lab file, no flight: walls, ceiling and limits of a real room are never guessed."""

from ipaddress import ip_address
from urllib.parse import urlsplit

from mocap_bridge.uri import is_live, scheme_of
from onboard.errors import InputError
from onboard.lab_file import LabFile
from perchhw.errors import FlightStackError


class LabRequired(FlightStackError, InputError):
    """A flight on hardware was asked for without a lab file."""


class NotLive(FlightStackError, InputError):
    """A flight was asked for by poses that are not of now."""


def require_lab(drone: str, mocap: str, lab: LabFile | None) -> None:
    """Refuse a flight without the lab file of a real room, unless it is simulated on this machine.

    Raises:
        LabRequired: the message names the address that is not.
        NotLive: the poses are a recording.
    """
    if not is_live(mocap):
        raise NotLive(
            f"{mocap} gives poses of another time, and nobody flies by them; see `perchhw mocap watch`"
        )
    if lab is not None and lab.clock is None:
        return
    for uri in (drone, mocap):
        if not on_this_machine(uri):
            raise LabRequired(
                f"{uri} is not on this machine, and on hardware nothing flies without a lab file: describe "
                "the room in lab.toml (docs/lab_file.md), and give --lab FILE or start from its folder. The "
                "file of a simulated lab describes no room"
            )


def on_this_machine(uri: str) -> bool:
    """Whether an address of a drone or of poses leads to this machine alone: to its loopback interface.

    Radio and USB never do. A name other than ``localhost`` is not looked up, and counts as elsewhere.
    """
    try:
        parts = urlsplit(uri)
        host = parts.hostname
    except ValueError:
        return False
    if parts.scheme in ("radio", "usb"):
        return False
    if host is None:
        kind = scheme_of(parts.scheme)  # the address is one to listen on, and none is given
        return kind is not None and not kind.needs_host
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False
