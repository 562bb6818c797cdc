"""A Rerun recording read back by Rerun's own reader."""

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from perchhw.view.timeline import TIMELINE

Rows = list[tuple[float, Any]]


def read(path: Path) -> dict[str, dict[str, Rows]]:
    """By entity and component: time (s; NaN for what is static) and value, in the order of time."""
    found: dict[str, dict[str, Rows]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        table = chunk.to_record_batch()
        entity = str(chunk.entity_path).removeprefix("/")
        times = _times(table, chunk.is_static)
        for name in table.schema.names:
            if ":" in name:
                values = table.column(name).to_pylist()
                rows = [(t, value) for t, value in zip(times, values, strict=True) if value is not None]
                found.setdefault(entity, {}).setdefault(name, []).extend(rows)
    for components in found.values():
        for rows in components.values():
            rows.sort(key=lambda row: row[0])
    return found


def _times(table: Any, static: bool) -> list[float]:
    if static or TIMELINE not in table.schema.names:
        return [float("nan")] * int(table.num_rows)
    nanoseconds = table.column(TIMELINE).to_numpy(zero_copy_only=False).astype("timedelta64[ns]")
    return [float(t) for t in nanoseconds.astype(np.int64) / 1e9]
