"""How reports look: colours, figures as inline SVG, the page, its sections and tables."""

import base64
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#1d232b"
MUTED = "#6b7480"
BLUE = "#2067b0"
ORANGE = "#d2691e"
GREEN = "#1a7f4b"
TRIGGER = "#c0392b"

RASTER_DPI = 160
"""Of what is drawn as pixels within a vector figure."""

_COLOURS = 256
"""Of a figure as pixels."""

_CSS = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1d232b; background: #f4f5f7; margin: 0; }
body { overflow-wrap: anywhere; }
main { max-width: 1080px; margin: 0 auto; padding: 28px 24px 48px; }
h1 { font-size: 25px; margin: 0 0 2px; } h2 { font-size: 17px; margin: 0 0 8px; }
h3 { font-size: 14px; margin: 14px 0 4px; } small { color: #6b7480; }
p.sub { color: #6b7480; margin: 0 0 18px; }
p.said { font-size: 17px; margin: 8px 0 4px; }
section { background: #fff; border: 1px solid #e1e4e8; border-radius: 8px; padding: 16px 18px; }
section { margin: 0 0 16px; min-width: 0; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(470px, 100%), 1fr)); }
.grid { gap: 16px; align-items: start; }
.grid section { margin: 0; } .grid + section, section + .grid { margin-top: 16px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 4px 12px 4px 0; border-bottom: 1px solid #edf0f2; vertical-align: top; }
th, td { overflow-wrap: normal; } table:not(.many) td:last-child { overflow-wrap: anywhere; }
th { color: #6b7480; font-weight: 600; } td.n { text-align: right; padding-right: 20px; }
span.n { white-space: nowrap; }
.badge { color: #fff; border-radius: 4px; padding: 1px 8px; font-size: 13px; white-space: nowrap; }
.note { color: #6b7480; font-size: 13px; margin: 6px 0 0; }
summary { cursor: pointer; color: #2067b0; }
svg, img { max-width: 100%; height: auto; display: block; }
.narrow { display: none; }
@media (max-width: 640px) {
  main { padding: 16px 8px 32px; } section { padding: 12px 10px; }
  .broad { display: none; } .narrow { display: block; }
  table.many thead { display: none; }
  table.many, table.many tbody, table.many tr, table.many td { display: block; width: 100%; }
  table.many tr { border-bottom: 2px solid #d5dade; padding: 6px 0; }
  table.many td { border: 0; padding: 1px 0; overflow-wrap: anywhere; } table.many td:empty { display: none; }
  table.many td::before { content: attr(data-label) " "; color: #6b7480; font-weight: 600; }
}
@media print {
  body { background: #fff; } main { max-width: none; padding: 0; }
  section { border: 0; padding: 0; break-inside: avoid; } .grid { display: block; }
  .grid section { margin: 0 0 12px; } .scroll { overflow: visible; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"""

_MANY_COLUMNS = 5
"""A table with as many is a list of cards where the page is narrow."""


def page(title: str, subtitle: str, body: str) -> str:
    """A complete HTML page that loads nothing from elsewhere."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_CSS}</style></head>\n"
        f'<body><main><h1>{escape(title)}</h1><p class="sub">{escape(subtitle)}</p>\n{body}\n'
        "</main></body></html>\n"
    )


def section(title: str, content: str, note: str = "", anchor: str = "") -> str:
    """A titled box; `content` is HTML. `anchor`: what links on the page lead to it by."""
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    named = f' id="{escape(anchor)}"' if anchor else ""
    return f'<section{named}><h2>{escape(title)}</h2><div class="scroll">{content}</div>{below}</section>\n'


def grid(sections: list[str]) -> str:
    """Boxes side by side where the page is wide enough."""
    return f'<div class="grid">{"".join(sections)}</div>\n'


def table(header: list[str], rows: list[list[str]]) -> str:
    """An HTML table; cells are HTML, the header is text. On a narrow page rows of a wide one are cards."""
    names = [escape(cell) for cell in header]
    head = "".join(f"<th>{name}</th>" for name in names)
    kind = ' class="many"' if len(header) >= _MANY_COLUMNS else ""
    body = "".join(f"<tr>{_cells(row, names if kind else [])}</tr>" for row in rows)
    return f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def text_table(header: list[str], rows: Iterable[Iterable[str]]) -> str:
    """A :func:`table` whose cells are text."""
    return table(header, [[escape(cell) for cell in row] for row in rows])


def _cells(row: list[str], names: list[str]) -> str:
    if not names:
        return "".join(f"<td>{cell}</td>" for cell in row)
    return "".join(f'<td data-label="{name}">{cell}</td>' for name, cell in zip(names, row, strict=False))


class Margins(NamedTuple):
    """Room around a figure's axes for what stands beside them (inches), and between them (of their size)."""

    left: float = 0.65
    right: float = 0.12
    top: float = 0.12
    bottom: float = 0.5
    between: float = 0.1


def new_figure(width: float, height: float, margins: Margins | None = None) -> "Figure":
    """A figure (inches) in the style of the reports; drawn without a display.

    With `margins` the axes of a regular grid have their places at once. Without, every label is measured
    first, which takes as long as to draw the figure.
    """
    from matplotlib.figure import Figure

    if margins is None:
        return Figure(figsize=(width, height), layout="constrained")
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(
        left=margins.left / width,
        right=1.0 - margins.right / width,
        bottom=margins.bottom / height,
        top=1.0 - margins.top / height,
        wspace=margins.between,
        hspace=margins.between,
    )
    return figure


@contextmanager
def report_style() -> Iterator[None]:
    """Within it, new axes look as the reports do."""
    import matplotlib

    settings: dict[Any, Any] = {
        "svg.hashsalt": "perchhw",
        "font.size": 9.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": MUTED,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#e6e9ec",
        "text.color": INK,
    }
    with matplotlib.rc_context(settings):
        yield


def svg(figure: "Figure", alt: str) -> str:
    """The figure as inline SVG; `alt` says what it shows to who cannot see it."""
    import matplotlib

    stream = io.StringIO()
    # Of figures on one page that show the same in two sizes, one is hidden: they must not share their parts.
    salt = f"perchhw {alt} {figure.get_size_inches()}"
    with matplotlib.rc_context({"svg.hashsalt": salt}):
        _lay_out(figure)
        figure.savefig(stream, format="svg", dpi=RASTER_DPI, metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    return f'<svg role="img" aria-label="{escape(alt)}"{text[4:]}'


def png(figure: "Figure", dpi: int) -> bytes:
    """The figure as a PNG file of few colours: a third of the size, and nobody sees the difference."""
    from PIL import Image

    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi, pil_kwargs={"compress_level": 0})
    image = Image.open(drawn).convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
    image.save(small, format="png", optimize=True)
    return small.getvalue()


def pixels(drawn: bytes, alt: str) -> str:
    """A PNG file (:func:`png`) within the page: less than SVG for what has many parts; `alt` as for that."""
    text = base64.b64encode(drawn).decode("ascii")
    return f'<img alt="{escape(alt)}" loading="lazy" src="data:image/png;base64,{text}">'


def _lay_out(figure: "Figure") -> None:
    """Give the parts of a figure their places, once: to save it would lay out and draw it twice."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    FigureCanvasSVG(figure)  # whose texts are as wide as those that are saved
    layout = figure.get_layout_engine()
    if layout is not None and figure.axes:
        layout.execute(figure)
        figure.set_layout_engine(None)


def by_width(draw: Callable[[bool], "Figure"], alt: str) -> str:
    """Two drawings of the same as inline SVG: a broad one, also for print, and one for a narrow page.

    Args:
        draw: gives the figure; told whether the page is broad.
        alt: as of :func:`svg`.
    """
    broad, narrow = svg(draw(True), alt), svg(draw(False), f"{alt} (narrow)")
    return f'<div class="broad">{broad}</div><div class="narrow">{narrow}</div>'
