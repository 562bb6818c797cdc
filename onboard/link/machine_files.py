"""Small files about drones that all processes of this machine share: who talks to one, who stopped it.

They are in ``/tmp/perchhw``. A place that an environment variable or a session decides on (``TMPDIR``,
``XDG_RUNTIME_DIR``) would not be the same for a terminal, a service and a second account, and a home folder
may be shared with other machines.
"""

import contextlib
import os
import re
import socket
from pathlib import Path

from onboard.link.uri import check_drone_uri, parse_udp_uri

FOLDER = Path("/tmp/perchhw")

_RADIO_DEFAULTS = ("2M", "E7E7E7E7E7")
_ADDRESS_DIGITS = 10
_UNFIT_FOR_NAMES = re.compile(r"[^\w.]+")


def file_of(uri: str, ending: str) -> Path:
    """Where the file of this kind about the drone at `uri` is; two addresses of one drone give one file.

    Raises:
        LinkInputError: the URI cannot be used.
    """
    return FOLDER / (_UNFIT_FOR_NAMES.sub("-", drone_key(uri)) + ending)


def files_ending(ending: str) -> list[Path]:
    """All files of this kind that there are now."""
    return sorted(FOLDER.glob(f"*{ending}"))


def drone_key(uri: str) -> str:
    """What two addresses of one drone have in common: no query, no name of a host, no number of a radio.

    Raises:
        LinkInputError: the URI cannot be used.
    """
    check_drone_uri(uri)
    address = uri.partition("?")[0]
    if address.startswith("udp://"):
        udp = parse_udp_uri(uri)
        host = udp.host.lower()
        with contextlib.suppress(OSError, UnicodeError):  # unknown: the link will say so
            host = socket.gethostbyname(host)
        if host == "0.0.0.0":  # this machine, to whoever sends there
            host = "127.0.0.1"
        return f"udp://{host}:{udp.port}"
    if address.startswith("radio://"):
        channel, *given = address.removeprefix("radio://").strip("/").split("/")[1:]
        rate, radio_address = (*given, *_RADIO_DEFAULTS[len(given) :])
        return f"radio://{int(channel)}/{rate}/{radio_address.upper().rjust(_ADDRESS_DIGITS, '0')}"
    return address


def open_for_all(path: Path) -> int:
    """Open the file to read and write; where it is not, make it, for every user.

    Raises:
        OSError: it cannot be opened or made.
    """
    with contextlib.suppress(FileExistsError):
        path.parent.mkdir()
        path.parent.chmod(0o1777)
    while True:
        # Without O_CREAT first: in such a folder the kernel refuses it for files of other users.
        with contextlib.suppress(FileNotFoundError):
            return os.open(path, os.O_RDWR | os.O_NOFOLLOW)
        with contextlib.suppress(FileExistsError):
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW)
            os.fchmod(file, 0o666)
            return file
