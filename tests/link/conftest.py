"""Fixtures of the link's tests: a tiny drone, and a link to it."""

from collections.abc import Iterator

import pytest

from onboard.link import DroneLink
from tests.link.tiny_drone import TinyDrone


@pytest.fixture
def tiny() -> Iterator[TinyDrone]:
    """A tiny drone of this test's own."""
    with TinyDrone() as drone:
        yield drone


@pytest.fixture
def link(tiny: TinyDrone) -> Iterator[DroneLink]:
    """A link to :func:`tiny`."""
    with DroneLink.open(tiny.uri, reply_timeout_s=0.5, transfer_timeout_s=3.0) as opened:
        yield opened
