"""Says in words why there is no instrument of ours on a port, from the bytes that came instead."""

import re

from calibration.bench.instruments.errors import (
    InstrumentError,
    InstrumentTimeout,
    WrongBaudRate,
    WrongDevice,
)

#: Share of bytes that are no text, above which the speed is wrong.
_GARBAGE_SHARE = 0.2
_LEGACY = re.compile(r"^\s*\d+\s*,\s*\d+(\.\d+)?\s*$")


def text_share(data: bytes) -> float:
    """Share of `data` that is printable ASCII or a line end; 1 for nothing."""
    if not data:
        return 1.0
    return sum(0x20 <= byte < 0x7F or byte in b"\r\n\t" for byte in data) / len(data)


def no_banner(device: str, baud: int, waited_s: float, data: bytes) -> InstrumentError:
    """The error for a port on which no banner came within `waited_s` [s], only `data`."""
    if not data:
        return InstrumentTimeout(
            f"{device} is silent for {waited_s:.1f} s: no instrument of ours, or without its sketch"
        )
    if text_share(data) < 1.0 - _GARBAGE_SHARE:
        return WrongBaudRate(
            f"{device} sends bytes that are no text at {baud} baud: the speed is wrong (our sketches use "
            "115200, the authors' tachometer 9600), or a ground wire is missing"
        )
    lines = [line.strip() for line in data.decode("ascii", "replace").splitlines() if line.strip()]
    if sum(bool(_LEGACY.match(line)) for line in lines) > len(lines) // 2:
        return WrongDevice(
            f"{device} sends 'millis, omega' lines: this is the authors' window-averaging tachometer. "
            "Its averages hide a time constant of 50 ms: load our sketch"
        )
    excerpt = max(lines, key=len, default="")[:40]
    return WrongDevice(f"{device} is another device: it sends {excerpt!r} and no banner of ours")
