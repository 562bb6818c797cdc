"""What the paper says of the leg designs (section V.E), as numbers from the pairs of a sweep of each.

All rates are mean landing rates (four legs, no contact) over the trials of a band; the best of the repeats
would flatter conditions that land by luck. Every number is positive where the paper's sentence holds.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import FloatArray
from perchhw.learning.bands import FAST
from perchhw.learning.sweep_folder import Row

BEYOND = 90.1
"""deg, upper border (not inside) of a band that reaches to the vertical."""

ALL_ANGLES = (0.0, BEYOND)
LOW, HIGH = (30.0, 65.0), (65.0, BEYOND)
"""deg, approach angles where the paper has semi-narrow legs succeed, and decline."""

NARROW_LOSES, NARROW_EXCELS = (30.0, 50.0), (50.0, BEYOND)
BETWEEN, LOWEST, VERTICAL = (45.0, 80.0), (30.0, 40.0), (80.0, BEYOND)
"""deg, where wide legs fall behind, and the ends where they do not ("very low or extremely vertical")."""

GOOD = 0.8
"""Landing rate of a pair that a policy is trained on (paper section III.D)."""

FAMILIES = ("narrow", "semi-narrow", "wide")


class Trend(NamedTuple):
    """One statement of the paper.

    Attributes:
        says: the statement.
        numbers: by what they compare; differences of landing rates, or correlations.
    """

    says: str
    numbers: dict[str, float]

    def holds(self) -> bool:
        """Whether every number is positive."""
        return all(value > 0.0 for value in self.numbers.values())


class Pairs(NamedTuple):
    """Columns of ``pairs.csv`` of one design: speed (m/s), angle (deg), rate, tau (s), |a_rot| (N m)."""

    speed: FloatArray
    angle_deg: FloatArray
    rate: FloatArray
    tau: FloatArray
    moment: FloatArray

    def mean_rate(
        self, angles: tuple[float, float] = ALL_ANGLES, speeds: tuple[float, float] = (0.0, math.inf)
    ) -> float:
        """Mean landing rate in a band: low <= angle < high, low <= speed < high; NaN without trials."""
        angle, speed = self.angle_deg, self.speed
        inside = (angle >= angles[0]) & (angle < angles[1]) & (speed >= speeds[0]) & (speed < speeds[1])
        return float(np.mean(self.rate[inside])) if inside.any() else math.nan


def pairs_of(rows: Sequence[Row]) -> Pairs:
    """The columns that the trends need."""
    names = ("speed_m_s", "angle_deg", "landing_rate", "tau", "a_rot")
    table = np.array([[math.nan if row[n] is None else row[n] for n in names] for row in rows], dtype=float)
    return Pairs(table[:, 0], table[:, 1], table[:, 2], table[:, 3], -table[:, 4])


def trends(designs: Mapping[str, Pairs]) -> dict[str, Trend]:
    """The trends that these designs show; numbers that need a design which is missing are left out."""
    return {**rate_trends(designs), **_known({"moment": _larger_moments_later(designs)})}


def rate_trends(designs: Mapping[str, Pairs]) -> dict[str, Trend]:
    """Those of the trends that compare landing rates."""
    return _known(
        {
            "speed": _speed_helps(designs),
            "semi_narrow": _semi_narrow_declines(designs),
            "narrow": _narrow_recovers(designs),
            "wide": _wide_falls_behind(designs),
            "length": _short_loses(designs),
        }
    )


def _known(found: Mapping[str, Trend]) -> dict[str, Trend]:
    finite = {
        name: Trend(trend.says, {key: value for key, value in trend.numbers.items() if math.isfinite(value)})
        for name, trend in found.items()
    }
    return {name: trend for name, trend in finite.items() if trend.numbers}


def _speed_helps(designs: Mapping[str, Pairs]) -> Trend:
    numbers = {
        name: pairs.mean_rate(speeds=(FAST, math.inf)) - pairs.mean_rate(speeds=(0.0, FAST))
        for name, pairs in designs.items()
    }
    return Trend(f"higher speed helps: from {FAST:g} m/s less below", numbers)


def _semi_narrow_declines(designs: Mapping[str, Pairs]) -> Trend:
    numbers = {
        f"{name}, 30-65 less 65-90 deg": designs[name].mean_rate(LOW) - designs[name].mean_rate(HIGH)
        for name in _of(designs, "semi-narrow")
    }
    if "semi-narrow-long" in designs and len(designs) > 1:
        others = max(pairs.mean_rate(LOW) for name, pairs in designs.items() if name != "semi-narrow-long")
        numbers["semi-narrow-long less the best other at 30-65 deg"] = (
            designs["semi-narrow-long"].mean_rate(LOW) - others
        )
    return Trend("semi-narrow-long is best at 30 to 65 deg and declines above", numbers)


def _narrow_recovers(designs: Mapping[str, Pairs]) -> Trend:
    numbers = {
        f"{name}, 50-90 less 30-50 deg": designs[name].mean_rate(NARROW_EXCELS)
        - designs[name].mean_rate(NARROW_LOSES)
        for name in _of(designs, "narrow")
    }
    for length in ("short", "long"):
        narrow, wider = f"narrow-{length}", f"semi-narrow-{length}"
        if narrow in designs and wider in designs:
            numbers[f"{narrow} less {wider} at 65-90 deg"] = designs[narrow].mean_rate(HIGH) - designs[
                wider
            ].mean_rate(HIGH)
    return Trend("narrow legs are better near the vertical than at low angles", numbers)


def _wide_falls_behind(designs: Mapping[str, Pairs]) -> Trend:
    numbers: dict[str, float] = {}
    for name in _of(designs, "wide"):
        wide = designs[name]
        ends = 0.5 * (wide.mean_rate(LOWEST) + wide.mean_rate(VERTICAL))
        numbers[f"{name}, ends less 45-80 deg"] = ends - wide.mean_rate(BETWEEN)
        others = [n for n in designs if n.endswith(name.removeprefix("wide")) and n != name]
        if others:
            numbers[f"worst other of its length less {name} at 45-80 deg"] = min(
                designs[n].mean_rate(BETWEEN) for n in others
            ) - wide.mean_rate(BETWEEN)
    return Trend("wide legs are worst in between", numbers)


def _short_loses(designs: Mapping[str, Pairs]) -> Trend:
    numbers = {
        family: designs[f"{family}-long"].mean_rate() - designs[f"{family}-short"].mean_rate()
        for family in FAMILIES
        if f"{family}-long" in designs and f"{family}-short" in designs
    }
    return Trend("short legs are worse than long ones", numbers)


def _larger_moments_later(designs: Mapping[str, Pairs]) -> Trend:
    from scipy.stats import spearmanr

    numbers: dict[str, float] = {}
    for name, pairs in designs.items():
        good = pairs.rate >= GOOD
        if np.count_nonzero(good) >= 10:
            numbers[name] = -float(spearmanr(pairs.moment[good], pairs.tau[good])[0])
    return Trend("larger |a_rot| at smaller tau: minus the rank correlation over good pairs", numbers)


def _of(designs: Mapping[str, Any], family: str) -> tuple[str, ...]:
    return tuple(name for name in (f"{family}-short", f"{family}-long") if name in designs)
