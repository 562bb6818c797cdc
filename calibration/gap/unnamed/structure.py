"""What of a residual is structure: beyond chance, and large enough to matter."""

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.gap.data.channels import ResidualChannel
from calibration.gap.unnamed.gap_map import Cell, GapMap
from calibration.gap.unnamed.lines import SpectralLine

LEVEL = 0.005
"""Chance that is believed in no longer, over the whole map."""

LEAST_SHARE = 0.04
"""Of a channel's block variance."""

LEAST_LINE = 0.03
"""Of a channel's variance."""

_LEAST_AMPLITUDE = {"force": 0.05, "torque": 0.5, "voltage": 0.0}
"""m/s2, rad/s2: what shakes a vehicle less has no consequence for a flight, however clear the line is."""

_ALIKE = 0.7
"""Share, in units of the best one's, from which another regressor may be meant."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Structure in one channel.

    Attributes:
        channel: where it lives.
        regressor: what it goes with; "time" for a line.
        condition: where, in words.
        share: of the variance: of blocks (map), of samples (line).
        p: family-wise.
        alike: other regressors that explain nearly as much.
        cell, line: what it was found by, the other is None.
    """

    channel: ResidualChannel
    regressor: str
    condition: str
    share: float
    p: float
    alike: tuple[str, ...] = ()
    cell: Cell | None = None
    line: SpectralLine | None = None


def structured(gap_map: GapMap, lines: Sequence[SpectralLine]) -> list[Structure]:
    """What remains and is no noise, largest share first; one place per axis and kind, and every line."""
    found = [*_places(gap_map), *(_line(line) for line in lines if _worth_telling(line))]
    return sorted(found, key=lambda structure: -structure.share)


def _places(gap_map: GapMap) -> list[Structure]:
    """The best regressor of each signal, in the frame in which it explains more."""
    best: dict[str, list[Cell]] = {}
    for cell in gap_map.cells:  # largest share first
        if cell.p < LEVEL and cell.share >= LEAST_SHARE:
            cells = best.setdefault(cell.channel.signal, [cell])
            if cell.channel is cells[0].channel and cell is not cells[0]:
                cells.append(cell)
    found = [
        Structure(
            first.channel,
            first.regressor.name,
            first.condition,
            first.share,
            first.p,
            alike=tuple(c.regressor.name for c in others if c.share >= _ALIKE * first.share),
            cell=first,
        )
        for first, *others in best.values()
    ]
    return [structure for structure in found if not any(_casts(other, structure) for other in found)]


def _casts(strong: Structure, weak: Structure) -> bool:
    """Whether a force is the other's shadow: along an axis of one frame it shows along all of the other."""
    return (
        strong.share > weak.share
        and strong.channel.kind == weak.channel.kind == "force"
        and strong.channel.frame != weak.channel.frame
        and strong.regressor == weak.regressor
    )


def _worth_telling(line: SpectralLine) -> bool:
    if line.p >= LEVEL or line.share < LEAST_LINE:
        return False
    return line.amplitude >= _LEAST_AMPLITUDE[line.channel.kind]


def _line(line: SpectralLine) -> Structure:
    condition = f"{line.amplitude:.3g} {line.channel.unit} at {line.frequency:.2f} Hz"
    return Structure(line.channel, "time", condition, line.share, line.p, line=line)
