"""A figure with what it means, as a section of a page and as a file."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from calibration.report_style import png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 150


@dataclass(frozen=True)
class Picture:
    """One figure of a report.

    Attributes:
        name: of its PNG file.
        title: of its section.
        meaning: what it shows, in a sentence or two.
        figure: matplotlib's.
    """

    name: str
    title: str
    meaning: str
    figure: "Figure"


def save_pictures(pictures: Iterable[Picture], folder: Path | None) -> None:
    """Write every figure as ``NAME.png`` with 256 colours into a folder; None for none."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        (folder / f"{picture.name}.png").write_bytes(png(picture.figure, _DPI))
