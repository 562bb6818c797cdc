"""Addresses of drones, checked before anything is connected and without importing cflib.

``udp://HOST:PORT[?silence_s=SECONDS]``, ``radio://DONGLE/CHANNEL[/RATE[/ADDRESS]]``, ``usb://NUMBER``; the
last two are cflib's (0.1.34, ``crtp/radiodriver.py`` and ``crtp/usbdriver.py``), which takes a data rate
that it does not know for 2M and fails on a wrong address with an error of ``struct``. ``connect_s=SECONDS``,
with udp or radio, is the least time for connecting.
"""

import math
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from onboard.link.errors import LinkInputError

#: No packet for this long although answers were asked for: the link is lost [s].
SILENCE_LIMIT = 1.0
#: Least time for connecting, unless the address says another [s].
CONNECT_LIMIT = 10.0
#: Example of each known scheme.
EXAMPLES = {
    "udp": "udp://127.0.0.1:19850",
    "radio": "radio://0/80/2M/E7E7E7E7E7",
    "usb": "usb://0",
}
_RADIO = re.compile(
    r"radio://[0-9A-Za-z]+/(?P<channel>\d{1,3})(/(250K|1M|2M)(/[0-9A-Fa-f]{1,10})?)?/?(\?(?P<query>.*))?"
)
_RADIO_CHANNEL_MAX = 125
_USB = re.compile(r"usb://\d+")


@dataclass(frozen=True, slots=True)
class UdpAddress:
    """A parsed ``udp://`` URI."""

    host: str
    port: int
    silence_s: float = SILENCE_LIMIT


def check_drone_uri(uri: str) -> None:
    """Refuse an address that no drone can have; connects to nothing.

    Raises:
        LinkInputError: unknown scheme (the message names the known ones), or malformed.
    """
    scheme, separator, _ = uri.partition("://")
    check = _CHECKS.get(scheme) if separator else None
    if check is None:
        raise LinkInputError(
            f"{uri!r} is not a drone address; the known schemes are {', '.join(EXAMPLES)}: "
            f"write e.g. {' or '.join(EXAMPLES.values())}"
        )
    check(uri)


def stop_command(uri: str) -> str:
    """What to type to stop the drone at `uri`: a ``?`` in it is the shell's, unless it is quoted."""
    return f"perchhw stop --drone {shlex.quote(uri)}"


def parse_udp_uri(uri: str) -> UdpAddress:
    """Read ``udp://HOST:PORT[?silence_s=SECONDS]``; other query keys are ignored, as cflib appends some.

    Raises:
        LinkInputError: the URI has no host or port, or a time in it is not a positive number.
    """
    hint = f"{uri!r} is not a usable drone address; write udp://HOST:PORT, for example {EXAMPLES['udp']}"
    try:
        parts = urlsplit(uri)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise LinkInputError(f"{hint} ({error})") from error
    if parts.scheme != "udp" or not host or not port or parts.path.strip("/"):
        raise LinkInputError(hint)
    connect_limit(uri)
    return UdpAddress(host, port, _seconds(uri, "silence_s") or SILENCE_LIMIT)


def _check_radio(uri: str) -> None:
    parts = _RADIO.fullmatch(uri)
    if parts is None or int(parts["channel"]) > _RADIO_CHANNEL_MAX:
        raise LinkInputError(
            f"{uri!r} is not a usable drone address; write radio://DONGLE/CHANNEL/RATE/ADDRESS with a "
            f"channel from 0 to {_RADIO_CHANNEL_MAX}, a rate of 250K, 1M or 2M and up to 10 hexadecimal "
            f"digits, for example {EXAMPLES['radio']}"
        )
    limit = parse_qs(parts["query"] or "").get("rate_limit", ["1"])[0]
    if not limit.isdecimal():
        raise LinkInputError(
            f"{uri!r}: rate_limit must be a whole number of packets per second, not {limit!r}"
        )

    connect_limit(uri)


def _check_usb(uri: str) -> None:
    if _USB.fullmatch(uri) is None:
        raise LinkInputError(
            f"{uri!r} is not a usable drone address; write usb://NUMBER, for example {EXAMPLES['usb']}"
        )


_CHECKS: dict[str, Callable[[str], object]] = {
    "udp": parse_udp_uri,
    "radio": _check_radio,
    "usb": _check_usb,
}


def silence_limit(uri: str) -> float:
    """Silence of the drone after which its link counts as lost, s."""
    return (_seconds(uri, "silence_s") if uri.startswith("udp://") else None) or SILENCE_LIMIT


def connect_limit(uri: str) -> float:
    """Least time to allow for connecting, s: what the address says, or 10 s, and more for one that may be
    silent for longer.

    Raises:
        LinkInputError: it does not say seconds.
    """
    return _seconds(uri, "connect_s") or CONNECT_LIMIT * patience(uri)


def _seconds(uri: str, key: str) -> float | None:
    """A time in the query of an address, or None."""
    values = parse_qs(urlsplit(uri).query, keep_blank_values=True).get(key)
    if values is None:
        return None
    try:
        seconds = float(values[0])
    except ValueError:
        seconds = math.nan
    if not (seconds > 0 and math.isfinite(seconds)):
        raise LinkInputError(f"{uri!r}: {key} must be more than 0 s and finite, not {values[0]}")
    return seconds


def patience(uri: str) -> float:
    """How many times as patient as usual to be with this drone, by the ``silence_s`` of its URI.

    More than 1 with a simulated one on a busy machine, never with a real one.
    """
    return max(1.0, silence_limit(uri) / SILENCE_LIMIT)
