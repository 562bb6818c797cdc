"""Radios and Crazyflies on this computer's USB, as Linux lists them."""

import os
from pathlib import Path

from perchhw.doctor.readings import UsbDevice

KNOWN = {
    ("1915", "7777"): "Crazyradio",
    ("35f0", "bad2"): "Crazyradio 2.0",
    ("0483", "5740"): "Crazyflie",
}
"""Names by vendor and product (bitcraze.io, USB permissions)."""


def usb_devices(
    listed: Path = Path("/sys/bus/usb/devices"), nodes: Path = Path("/dev/bus/usb")
) -> tuple[UsbDevice, ...]:
    """What of :data:`KNOWN` is plugged in; empty where the system lists nothing.

    Args:
        listed: a folder a device, with files of its numbers. nodes: BUS/DEVICE, the files to use them by.
    """
    found = []
    for folder in sorted(listed.glob("*")):
        name = KNOWN.get((_read(folder / "idVendor"), _read(folder / "idProduct")))
        if name is not None:
            node = nodes / _read(folder / "busnum").zfill(3) / _read(folder / "devnum").zfill(3)
            found.append(UsbDevice(name=name, node=str(node), usable=os.access(node, os.R_OK | os.W_OK)))
    return tuple(found)


def _read(file: Path) -> str:
    return file.read_text(encoding="ascii").strip() if file.is_file() else ""
