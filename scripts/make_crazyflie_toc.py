"""Write the simulated Crazyflie's tables of contents from a dump of the real firmware's symbol tables.

    python scripts/make_crazyflie_toc.py DUMP.json

``DUMP.json`` holds ``{"log": {"crc", "items"}, "param": {"crc", "items"}}`` of a default build of
bitcraze/crazyflie-firmware 2a18fc29 (2026.08), platform cf2. The dump merges neighbouring rows of one
group; in the firmware some groups are opened and closed several times, once in each source file that adds
to them, and each of those rows is part of the table's CRC. ``REOPENED`` says where. The script refuses to
write a table whose CRC is not the firmware's own.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.crazyflie.toc import TOC_FOLDER, Block, Row, format_blocks, table_crc

#: Variables before which the firmware closes the group and opens it again (``git grep GROUP_START`` in its
#: src/).
REOPENED = {
    "log": {
        *("deckStatus.bcLoco", "ranging.distance0", "motor.m1req", "gyro.x", "controller.cmd_thrust"),
        *("sys.testLogParam", "lighthouse.posRt", "lighthouse.disProb"),
    },
    "param": {
        *(
            "deck.bcAI",
            "deck.bcBuzzer",
            "deck.bcFlow",
            "deck.bcLedRing",
            "deck.bcLighthouse4",
            "deck.bcDWM1000",
        ),
        *("deck.bcMultiranger", "deck.bcOA", "deck.bcUSD", "deck.bcZRanger", "deck.bcZRanger2"),
        *(
            "deck.bcColorLedBot",
            "deck.bcCam",
            "system.storageStats",
            "system.taskDump",
            "system.selftestPassed",
        ),
        *("imu_sensors.AK8963", "kalman.resetEstimation", "stabilizer.stop", "lighthouse.sweepStd"),
        *("lighthouse.enLhRawStream", "lighthouse.lh2maxRate"),
    },
}


def blocks_of(kind: str, items: list[dict[str, Any]]) -> list[Block]:
    """Group the dump's items into the blocks between the firmware's group start and stop rows."""
    blocks: list[Block] = []
    for item in items:
        group, name = item["group"], item["name"]
        if not blocks or blocks[-1].group != group or f"{group}.{name}" in REOPENED[kind]:
            blocks.append(Block(group, ()))
        row = Row(name, item["type"], item.get("ext_type", 0), shortest(item.get("default", 0)))
        blocks[-1] = Block(group, (*blocks[-1].rows, row))
    return blocks


def shortest(value: float | int) -> float | int:
    """The shortest decimal that is the same 32-bit float."""
    return float(str(np.float32(value))) if isinstance(value, float) else value


def main() -> int:
    """Write ``log.tsv`` and ``param.tsv``; exit code 1 when a CRC differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dump", type=Path)
    dump = json.loads(parser.parse_args().dump.read_text(encoding="utf-8"))
    for kind in ("log", "param"):
        blocks = blocks_of(kind, dump[kind]["items"])
        crc = table_crc(blocks)
        if f"{crc:08X}" != dump[kind]["crc"]:
            sys.stderr.write(
                f"{kind}: CRC {crc:08X} is not the firmware's {dump[kind]['crc']}; check REOPENED\n"
            )
            return 1
        (TOC_FOLDER / f"{kind}.tsv").write_text(format_blocks(kind, blocks), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
