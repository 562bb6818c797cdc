"""A computer that was too busy for a flight in real time, by the record."""

from collections.abc import Mapping
from typing import Any

from perchhw.diagnosis.finding import Cause, Number

SLOWEST = 0.98
"""Least s of the drone's clock in a second of the flight's; a simulated lab that is late falls below."""
MOST_WAITING = 2.0
"""Processes to a processor, above which what is late may be late for that reason."""
REMEDY = (
    "end other programs on this computer, or serve the simulated lab with --pace lockstep, in which no "
    "flight depends on them"
)
_MAY_BE_LATE = (
    Cause.MOCAP_SILENT,
    Cause.MOCAP_LATE,
    Cause.LINK_LOST,
    Cause.ESTIMATE_WRONG,
    Cause.OFF_PATH,
    Cause.START_NOT_REACHED,
    Cause.TUMBLED,
)
"""What a late computer can be the reason of."""
_BY_A_LATE_LAB = (*_MAY_BE_LATE, Cause.MOCAP_OCCLUDED)
"""What a simulated lab that is late can be the reason of: its cameras see no drone whose state is old."""


def busy_words(info: Mapping[str, Any], cause: Cause) -> tuple[str, dict[str, Number]] | None:
    """What ``run.json`` says of a computer that was too busy, where that can be behind `cause`, or None."""
    return (
        too_busy(info)
        if cause in (_MAY_BE_LATE if _rate_of_late_lab(info) is None else _BY_A_LATE_LAB)
        else None
    )


def too_busy(info: Mapping[str, Any]) -> tuple[str, dict[str, Number]] | None:
    """What ``run.json`` says of a computer that was too busy, in words and numbers, or None."""
    words, numbers = [], dict[str, Number]()
    rate, host = _rate_of_late_lab(info), info.get("host") or {}
    if rate is not None:
        words.append(f"the lab ran at {rate:.2f} of real time")
        numbers["drone_clock_rate"] = rate
    cpus, load = host.get("cpus"), host.get("load")
    if isinstance(cpus, int) and isinstance(load, float) and load > MOST_WAITING * cpus:
        words.append(f"its load was {load:.0f} on {cpus} processors")
        numbers |= {"load": load, "cpus": cpus}
    return (f"this computer was too busy: {', '.join(words)}", numbers) if words else None


def _rate_of_late_lab(info: Mapping[str, Any]) -> float | None:
    rate = info.get("drone_clock_rate")
    return rate if isinstance(rate, float) and rate < SLOWEST else None
