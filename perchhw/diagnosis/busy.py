"""A computer that was too busy for a flight in real time, by the record."""

from collections.abc import Mapping
from typing import Any

from perchhw.diagnosis.finding import Cause, Number

SLOWEST = 0.98
"""Least s of the drone's clock in a second of the flight's; a simulated lab that is late falls below."""
MOST_WAITING = 2.0
"""Processes to a processor, above which what is late may be late for that reason."""
LATE_S = 0.1
"""Longest wait of something for the flight's program; above it, that may have broken a rule of silence."""
LATE_FOR_POSES_S = 0.01
"""The same; above it, ages and gaps of poses may be the computer's. A quiet one stays below 3 ms."""
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
    """What ``run.json`` says of a computer that was too busy for a rule of a flight, in words and numbers, or
    None.
    """
    return _said(_lab(info), _program(info, LATE_S), _load(info))


def too_busy_for_poses(info: Mapping[str, Any]) -> str | None:
    """How a computer was too busy to judge when poses came, in words, or None. Its load says so only of
    records that do not hold how long something waited for the flight's program.
    """
    measured = isinstance(_host(info).get("late_s"), float)
    said = _said(_lab(info), _program(info, LATE_FOR_POSES_S), None if measured else _load(info))
    return None if said is None else said[0]


_Found = tuple[str, dict[str, Number]] | None


def _said(*found: _Found) -> _Found:
    known = [one for one in found if one is not None]
    words = ", ".join(words for words, _ in known)
    numbers = {name: number for _, each in known for name, number in each.items()}
    return (f"this computer was too busy: {words}", numbers) if known else None


def _host(info: Mapping[str, Any]) -> Mapping[str, Any]:
    return info.get("host") or {}


def _lab(info: Mapping[str, Any]) -> _Found:
    rate = _rate_of_late_lab(info)
    return None if rate is None else (f"the lab ran at {rate:.2f} of real time", {"drone_clock_rate": rate})


def _program(info: Mapping[str, Any], longest: float) -> _Found:
    late = _host(info).get("late_s")
    if not isinstance(late, float) or late <= longest:
        return None
    return f"the flight's program was late by {late * 1e3:.0f} ms", {"late_s": late}


def _load(info: Mapping[str, Any]) -> _Found:
    cpus, load = _host(info).get("cpus"), _host(info).get("load")
    if not isinstance(cpus, int) or not isinstance(load, float) or load <= MOST_WAITING * cpus:
        return None
    return f"its load was {load:.0f} on {cpus} processors", {"load": load, "cpus": cpus}


def _rate_of_late_lab(info: Mapping[str, Any]) -> float | None:
    rate = info.get("drone_clock_rate")
    return rate if isinstance(rate, float) and rate < SLOWEST else None
