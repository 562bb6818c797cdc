"""Addresses of drones: what is refused before anything is connected."""

import subprocess
import sys

import pytest

from onboard.errors import InputError
from onboard.link import DroneLink, check_drone_uri, reboot
from onboard.link.uri import connect_limit, parse_udp_uri


@pytest.mark.parametrize(
    "uri",
    [
        "udp://127.0.0.1:19850",
        "udp://[::1]:19850?silence_s=2",
        "udp://127.0.0.1:19850?connect_s=60&time=127.0.0.1:40000",
        "radio://0/80/2M/E7E7E7E7E7?connect_s=60",
        "radio://0/80/2M/E7E7E7E7E7",
        "radio://0/80/250K",
        "radio://A1B2C3D4E5/125/1M/e7e7e7e701?rate_limit=100",
        "radio://0/80",
        "usb://0",
    ],
)
def test_usable_addresses_pass(uri: str) -> None:
    check_drone_uri(uri)


@pytest.mark.parametrize(
    "uri", ["", "foo://1", "udp:/nonsense", "127.0.0.1:19850", "UDP://h:1", "udp", "://h:1"]
)
def test_unknown_schemes_name_the_known_ones(uri: str) -> None:
    with pytest.raises(InputError, match="known schemes are udp, radio, usb") as caught:
        DroneLink.open(uri)
    assert repr(uri) in str(caught.value)
    with pytest.raises(InputError, match="known schemes are udp, radio, usb"):
        reboot(uri)


@pytest.mark.parametrize(
    "uri",
    [
        "udp://",
        "udp://127.0.0.1",
        "udp://127.0.0.1:0",
        "udp://127.0.0.1:19850/nonsense",
        "udp://:19850",
        "udp://h:99999",
        "udp://[::1:19850",
        "udp://h:1?silence_s=-1",
        "udp://h:1?silence_s=nan",
        "udp://h:1?silence_s=inf",
        "udp://h:1?connect_s=0",
        "udp://h:1?connect_s=",
        "radio://0/80/2M?connect_s=soon",
        "radio://",
        "radio://0",
        "radio://0/126/2M",
        "radio://0/80/3M",
        "radio://0/80/2M/E7E7E7E7E7E7",
        "radio://0/80/2M/XYZ",
        "radio://0/80/2M?rate_limit=fast",
        "usb://",
        "usb://x",
    ],
)
def test_malformed_addresses_are_input_errors(uri: str) -> None:
    for use in (check_drone_uri, DroneLink.open):
        with pytest.raises(InputError) as caught:
            use(uri)
        assert uri in str(caught.value)


def test_query_keys_of_cflib_are_tolerated() -> None:
    address = parse_udp_uri("udp://127.0.0.1:19850?safelink=0&autoping=0&silence_s=2.5")
    assert (address.port, address.silence_s) == (19850, 2.5)


def test_the_check_does_not_import_cflib() -> None:
    program = (
        "import sys; from onboard.link import check_drone_uri; "
        "check_drone_uri('radio://0/80/2M'); sys.exit('cflib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_the_address_says_how_long_to_wait_for_a_connection() -> None:
    assert connect_limit("udp://h:1") == 10.0
    assert connect_limit("radio://0/80/2M?connect_s=60") == 60.0
    assert connect_limit("udp://h:1?silence_s=3") == 30.0
    assert connect_limit("udp://h:1?silence_s=3&connect_s=0.5") == 0.5
