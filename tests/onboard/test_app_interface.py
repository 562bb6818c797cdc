"""The app's interface: what the firmware's tables can hold, and the numbers of the contract."""

import pytest

from onboard.app_interface import (
    INTERFACE_VERSION,
    LOGS,
    MEMORY_SIZE,
    MEMORY_TYPE_APP,
    PARAMETERS,
    REQUEST_TIMEOUT_MS,
    LandingState,
    Log,
    Parameter,
    PolicyStatus,
    Rehearsal,
    TrajectoryStatus,
    ValueType,
)


def test_tables_hold_every_name_once() -> None:
    assert [entry.name for entry in PARAMETERS] == list(Parameter)
    assert [entry.name for entry in LOGS] == list(Log)


@pytest.mark.parametrize("name", [*Parameter, *Log])
def test_names_fit_a_packet_of_the_table_of_contents(name: str) -> None:
    """crazyflie_protocol 1.2: group and name with their terminators take at most 26 bytes."""
    group, _, variable = name.partition(".")
    assert group in ("perch", "perchT", "perchM")
    assert variable
    assert len(group) + len(variable) + 2 <= 26


def test_what_the_drone_answers_is_read_only() -> None:
    read_only = {entry.name for entry in PARAMETERS if entry.read_only}
    assert read_only == {
        Parameter.POLICY_STATUS,
        Parameter.POLICY_ACTIVE_CRC,
        Parameter.TRAJECTORY_STATUS,
        Parameter.STATE,
        Parameter.VEHICLE_CRC,
        Parameter.VERSION,
        Parameter.ENGINE,
    }
    types = {entry.name: entry.type for entry in PARAMETERS}
    assert types[Parameter.POLICY_ACTIVE_CRC] is ValueType.UINT32
    assert types[Parameter.VEHICLE_CRC] is ValueType.UINT32


def test_numbers_are_those_of_the_contract() -> None:
    """The app in C has the same numbers; a change here is a change of the interface's version."""
    assert [int(state) for state in LandingState] == list(range(8))
    assert LandingState.CUT == 4
    assert {int(status) for status in PolicyStatus} == {0, 1, 16, 17, 18, 19, 20, 21}
    assert {int(status) for status in TrajectoryStatus} == {0, 1, 2, 16, 17, 18}
    assert [int(kind) for kind in Rehearsal] == [0, 1, 2]
    assert (MEMORY_TYPE_APP, MEMORY_SIZE) == (0x18, 5120)
    assert (INTERFACE_VERSION, REQUEST_TIMEOUT_MS) == (2, 20)
