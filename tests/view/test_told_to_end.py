"""A viewer that is told to end does so, also where Python drops the signal's exception."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest

from perchhw.cli.view import until_told_to_end


@pytest.fixture(params=[signal.SIGTERM, signal.SIGINT])
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    before = {one: signal.getsignal(one) for one in (signal.SIGTERM, signal.SIGINT)}
    yield request.param
    for one, handler in before.items():
        signal.signal(one, handler)


class Finalized:
    """Gone, it lets a signal strike where nobody can catch its exception."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number
        self.itself = self

    def __del__(self) -> None:
        os.kill(os.getpid(), self.number)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_next_wait_ends_it_when_the_exception_was_lost(number: signal.Signals) -> None:
    wait = until_told_to_end()
    wait(0.0)
    Finalized(number)
    gc.collect()  # the exception is dropped here
    with pytest.raises(KeyboardInterrupt):
        wait(0.0)


def test_elsewhere_it_ends_at_once(number: signal.Signals) -> None:
    until_told_to_end()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
