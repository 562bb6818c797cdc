"""The groups that our firmware app adds to the firmware's tables of contents, as rows of the table."""

from sim_backend.crazyflie.toc import READ_ONLY, Block, LogType, ParamType, Row

_PARAMS: dict[str, dict[str, tuple[ParamType, bool, int]]] = {
    "perch": {
        "version": (ParamType.U8, True, 1),
        "polLen": (ParamType.U16, False, 0),
        "polCrc": (ParamType.U32, False, 0),
        "polCommit": (ParamType.U8, False, 0),
        "polStat": (ParamType.U8, True, 0),
        "polActCrc": (ParamType.U32, True, 0),
        "polArm": (ParamType.U8, False, 0),
        "trjArm": (ParamType.U8, False, 0),
        "trjStat": (ParamType.U8, True, 0),
        "go": (ParamType.U8, False, 0),
        "abort": (ParamType.U8, False, 0),
        **dict.fromkeys(
            ("zCeil", "xImp", "yImp", "vx", "vz", "ax", "az", "tau0"), (ParamType.FLOAT, False, 0)
        ),
    }
}
_FLOATS = ("tau", "thetaX", "dCeil", "trigVal", "aRot")
_LOGS: dict[str, dict[str, LogType]] = {
    "perch": {
        "state": LogType.U8,
        **dict.fromkeys(_FLOATS, LogType.FLOAT),
        "polCrc": LogType.U32,
        "polStat": LogType.U8,
    },
    "perchT": {
        "count": LogType.U8,
        "tick": LogType.U32,
        **dict.fromkeys((*_FLOATS, "vx", "vy", "vz", "z", "pitch"), LogType.FLOAT),
    },
}


def app_blocks(kind: str) -> list[Block]:
    """The app's groups; ``kind`` is ``log`` or ``param``."""
    if kind == "log":
        return [
            Block(group, tuple(Row(name, int(type_)) for name, type_ in rows.items()))
            for group, rows in _LOGS.items()
        ]
    return [
        Block(
            group,
            tuple(
                Row(name, int(type_) | (READ_ONLY if read_only else 0), 0, default)
                for name, (type_, read_only, default) in rows.items()
            ),
        )
        for group, rows in _PARAMS.items()
    ]
