"""Fixtures of the link's tests: a tiny drone, and links to it."""

from collections.abc import Iterator

import pytest

from onboard.link import DroneLink
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link


@pytest.fixture
def tiny() -> Iterator[TinyDrone]:
    """A tiny drone of this test's own."""
    with TinyDrone() as drone:
        yield drone


@pytest.fixture
def link(tiny: TinyDrone) -> Iterator[DroneLink]:
    """A link to :func:`tiny` that waits for a busy machine."""
    with patient_link(tiny.uri) as opened:
        yield opened


@pytest.fixture
def hasty(tiny: TinyDrone) -> Iterator[DroneLink]:
    """A link to :func:`tiny` for questions that stay without an answer."""
    with patient_link(tiny.uri, reply_timeout_s=0.5) as opened:
        yield opened


@pytest.fixture
def drone_link(crazyflie_uri: str) -> Iterator[DroneLink]:
    """A link to a simulated drone of its module that waits for a busy machine."""
    with patient_link(crazyflie_uri) as opened:
        yield opened
