"""The snapshot of the trigger comes in two log blocks; one that is torn is no snapshot."""

from collections.abc import Callable, Collection, Sequence
from typing import Any

import pytest

from onboard.app_interface import LOGS, Log, ValueType
from onboard.link.drone import LogSample
from perchhw.flight.host_load import Lateness
from perchhw.flight.telemetry import BLOCKS, LoggedField, Telemetry, TelemetryBlock

WATCHED = TelemetryBlock(10, {Log.SNAPSHOT_COUNT: LoggedField("trigger", "count")})
CUES, MOTION = BLOCKS[-2:]
SIZES = {ValueType.UINT8: 1, ValueType.UINT16: 2, ValueType.UINT32: 4, ValueType.FLOAT: 4}


class Blocks:
    """Stands for the link: the log blocks in the test's hands."""

    def __init__(self) -> None:
        self._receivers: list[Callable[[LogSample], None]] = []
        self._time_ms = 0

    def has_log(self, name: str) -> bool:
        """As a drone without our app."""
        return False

    def stream(
        self,
        variables: Sequence[str],
        period_ms: int,
        callback: Callable[[LogSample], None],
        halves: Collection[str],
    ) -> None:
        self._receivers.append(callback)

    def send(self, block: TelemetryBlock, count: int, value: float) -> None:
        self._time_ms += 10
        index = (WATCHED, CUES, MOTION).index(block)
        values = dict.fromkeys(block.variables, value) | {str(Log.SNAPSHOT_COUNT): count}
        self._receivers[index](LogSample(self._time_ms, self._time_ms / 1000.0, values))


def watched() -> tuple[Blocks, Telemetry]:
    link: Any = Blocks()
    nobody: Any = None
    telemetry = Telemetry(link, nobody, nobody, nobody, lambda: 0.0, (WATCHED, CUES, MOTION))
    telemetry.start()
    return link, telemetry


def test_how_long_a_message_waited_is_told_once_it_flies() -> None:
    link: Any = Blocks()
    nobody: Any = None
    lateness, now = Lateness(), 0.3
    telemetry = Telemetry(link, nobody, nobody, nobody, lambda: now, (WATCHED, CUES, MOTION), lateness)
    telemetry.start()
    link.send(WATCHED, 0, 0.0)
    assert lateness.worst == 0.0
    lateness.watched, now = True, 0.27
    link.send(WATCHED, 0, 0.0)
    now = 0.03
    link.send(WATCHED, 0, 0.0)
    assert lateness.worst == pytest.approx(0.25)  # received at 0.02 s


def test_both_blocks_carry_the_count_and_fit_a_packet() -> None:
    types = {entry.name: entry.type for entry in LOGS}
    for block in (CUES, MOTION):
        assert Log.SNAPSHOT_COUNT in block.variables
        assert sum(SIZES[types[Log(name)]] for name in block.variables) <= 26
    snapshot = {entry.name for entry in LOGS if entry.name.startswith("perchT.")}
    assert set(CUES.variables) | set(MOTION.variables) == snapshot


def test_a_torn_snapshot_is_none_until_both_blocks_are_of_one_trigger() -> None:
    link, telemetry = watched()
    assert telemetry.trigger_snapshot() is None
    link.send(WATCHED, 0, 0.0)
    link.send(CUES, 0, 1.0)
    link.send(MOTION, 0, 1.0)
    assert telemetry.trigger_snapshot() is None, "it never fired"
    link.send(WATCHED, 1, 0.0)
    assert telemetry.trigger_snapshot() is None
    link.send(CUES, 1, 2.0)
    assert telemetry.trigger_snapshot() is None, "cues of this trigger, motion of before"
    link.send(MOTION, 1, 2.0)
    snapshot = telemetry.trigger_snapshot()
    assert snapshot is not None
    assert snapshot.pop("count") == 1
    assert set(snapshot.values()) == {2.0}
    link.send(MOTION, 2, 3.0)
    assert telemetry.trigger_snapshot() is None, "motion of the next"
