"""Other processes that talk to a drone: each opens a link when it starts and closes it when told."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.conftest import REPOSITORY

_CLIENT = """
import sys
from onboard.errors import PerchhwError
from tests.patience import patient_link
try:
    link = patient_link(sys.argv[1])
except PerchhwError as error:
    print(type(error).__name__, error, flush=True)
    raise SystemExit(2)
print("open", flush=True)
sys.stdin.read()
link.close()
"""


def start_client(uri: str) -> "subprocess.Popen[str]":
    """A process that connects, says so in a line, and closes when its standard input does."""
    return subprocess.Popen(
        [sys.executable, "-c", _CLIENT, uri],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,  # of which `tests` is a package
    )


def first_line(client: "subprocess.Popen[str]") -> str:
    """What a client says first: ``open``, or why it is not."""
    assert client.stdout is not None
    return client.stdout.readline().strip()


@contextmanager
def connected_elsewhere(uri: str) -> Iterator["subprocess.Popen[str]"]:
    """Another process is connected meanwhile."""
    with start_client(uri) as client:
        try:
            assert first_line(client) == "open"
            yield client
        finally:
            client.kill()
