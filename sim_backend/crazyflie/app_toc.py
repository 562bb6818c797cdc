"""The groups that our firmware app adds to the firmware's tables of contents, as rows of the table."""

from collections.abc import Iterable
from itertools import groupby

from onboard.app_interface import LOGS, PARAMETERS, ParameterEntry, ValueType
from sim_backend.crazyflie.toc import READ_ONLY, Block, LogType, ParamType, Row

_LOG_TYPES = {
    ValueType.UINT8: LogType.U8,
    ValueType.UINT16: LogType.U16,
    ValueType.UINT32: LogType.U32,
    ValueType.FLOAT: LogType.FLOAT,
}
_PARAM_TYPES = {
    ValueType.UINT8: ParamType.U8,
    ValueType.UINT16: ParamType.U16,
    ValueType.UINT32: ParamType.U32,
    ValueType.FLOAT: ParamType.FLOAT,
}


def app_blocks(kind: str) -> list[Block]:
    """The app's groups in the order of ``onboard.app_interface``; ``kind`` is ``log`` or ``param``."""
    if kind == "log":
        return _blocks((entry.name, Row(_name(entry.name), int(_LOG_TYPES[entry.type]))) for entry in LOGS)
    return _blocks((entry.name, _param_row(entry)) for entry in PARAMETERS)


def _param_row(entry: ParameterEntry) -> Row:
    flags = READ_ONLY if entry.read_only else 0
    return Row(_name(entry.name), _PARAM_TYPES[entry.type] | flags, 0, entry.default)


def _name(full_name: str) -> str:
    return full_name.partition(".")[2]


def _blocks(variables: Iterable[tuple[str, Row]]) -> list[Block]:
    by_group = groupby(variables, key=lambda variable: variable[0].partition(".")[0])
    return [Block(group, tuple(row for _, row in members)) for group, members in by_group]
