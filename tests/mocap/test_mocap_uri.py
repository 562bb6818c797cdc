import pytest

from mocap_bridge.errors import MocapUriError
from mocap_bridge.pose import open_pose_stream
from mocap_bridge.uri import MocapUri, parse_mocap_uri
from onboard.errors import InputError


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("vicon://10.0.0.5?subject=cf1", MocapUri("vicon", "10.0.0.5", 801, "cf1")),
        ("vicon://lab-pc:18801?subject=cf%201", MocapUri("vicon", "lab-pc", 18801, "cf 1")),
        ("vicon://[::1]:18801/?subject=cf1", MocapUri("vicon", "::1", 18801, "cf1")),
        ("vicon-udp://:51001?subject=cf1", MocapUri("vicon-udp", "127.0.0.1", 51001, "cf1")),
        ("vicon-udp://?subject=cf1", MocapUri("vicon-udp", "127.0.0.1", 51001, "cf1")),
        ("vicon-udp://0.0.0.0:51001?subject=cf1", MocapUri("vicon-udp", "0.0.0.0", 51001, "cf1")),
        ("vicon-udp://[::]:51001?subject=cf1", MocapUri("vicon-udp", "::", 51001, "cf1")),
        ("vicon-udp://127.0.0.1?subject=cf1", MocapUri("vicon-udp", "127.0.0.1", 51001, "cf1")),
    ],
)
def test_good_uris(text: str, expected: MocapUri):
    assert parse_mocap_uri(text) == expected
    assert parse_mocap_uri(str(expected)) == expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "unknown scheme"),
        ("optitrack://host?subject=cf1", "unknown scheme 'optitrack'"),
        ("vicon://?subject=cf1", "host is missing"),
        ("vicon://host", "exactly one subject"),
        ("vicon://host?subject=", "exactly one subject"),
        ("vicon://host?subject=a&subject=b", "exactly one subject"),
        ("vicon://host?subjct=cf1", "unknown option 'subjct'"),
        ("vicon://host:99999?subject=cf1", "Port out of range"),
        ("vicon://host:x?subject=cf1", "Port could not be cast"),
        ("vicon://host:0?subject=cf1", "port 0"),
        ("vicon://host/path?subject=cf1", "only host, port"),
        ("vicon://user@host?subject=cf1", "only host, port"),
        ("vicon://[::1?subject=cf1", "Invalid IPv6"),
        ("vicon://host?subject=a%00b", "printable"),
    ],
)
def test_bad_uris_say_what_is_wrong_and_are_input_errors(text: str, says: str):
    with pytest.raises(MocapUriError, match=says) as caught:
        open_pose_stream(text)
    assert isinstance(caught.value, InputError)
