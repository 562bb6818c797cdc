"""Where MAVLink goes: ``mavlink://[HOST][:PORT][?key=FILE]``, this computer and port 14550 unless given."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from mocap_bridge.errors import MocapUriError
from mocap_bridge.uri import LOOPBACK

GROUND_STATION_PORT = 14550
"""Where ground stations listen (https://mavlink.io/en/about/faq.html and QGroundControl's manual)."""
KEY_BYTES = 32
EXAMPLE = f"mavlink://127.0.0.1:{GROUND_STATION_PORT}"


@dataclass(frozen=True, slots=True)
class MavlinkAddress:
    """A parsed address.

    Attributes:
        host, port: UDP, where packets are sent.
        key: 32 bytes that packets are signed with, and that those taken must be signed with; None: unsigned.
    """

    host: str
    port: int
    key: bytes | None

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"mavlink://{host}:{self.port}"


def parse_mavlink_address(text: str) -> MavlinkAddress:
    """Parse `text`, and read the key that it names.

    Raises:
        MocapUriError: not such an address, or the key cannot be used.
    """
    try:
        parts = urlsplit(text)
        port = parts.port or GROUND_STATION_PORT
        options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    except ValueError as error:
        raise MocapUriError(f"MAVLink address {text!r}: {error}; write e.g. {EXAMPLE}") from error
    if parts.scheme != "mavlink" or parts.path not in ("", "/") or parts.username or parts.fragment:
        raise MocapUriError(f"MAVLink address {text!r}: write mavlink://HOST:PORT, e.g. {EXAMPLE}")
    key = options.pop("key", None)
    if options:
        raise MocapUriError(f"MAVLink address {text!r}: unknown option {next(iter(options))!r}; only key is")
    return MavlinkAddress(parts.hostname or LOOPBACK, port, None if key is None else read_key(key))


def read_key(file: str) -> bytes:
    """The signing key in `file`: 64 hexadecimal digits.

    Raises:
        MocapUriError: no such file, or not such a key.
    """
    try:
        key = bytes.fromhex(Path(file).read_text(encoding="ascii").strip())
    except (OSError, ValueError) as error:
        raise MocapUriError(f"MAVLink key {file}: {error}; it is a text file of 64 hex digits") from error
    if len(key) != KEY_BYTES:
        raise MocapUriError(f"MAVLink key {file}: {len(key)} bytes; it is a text file of 64 hex digits")
    return key
