"""How reports look: colours, figures as inline SVG, the page, its sections and tables."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

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

_CSS = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1d232b; background: #f4f5f7; margin: 0; }
main { max-width: 1080px; margin: 0 auto; padding: 28px 24px 48px; }
h1 { font-size: 25px; margin: 0 0 2px; } h2 { font-size: 17px; margin: 0 0 8px; }
h3 { font-size: 14px; margin: 14px 0 4px; } small { color: #6b7480; }
p.sub { color: #6b7480; margin: 0 0 18px; }
section { background: #fff; border: 1px solid #e1e4e8; border-radius: 8px; padding: 16px 18px; }
section { margin: 0 0 16px; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(470px, 1fr)); }
.grid { gap: 16px; align-items: start; }
.grid section { margin: 0; } .grid + section, section + .grid { margin-top: 16px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 4px 12px 4px 0; border-bottom: 1px solid #edf0f2; vertical-align: top; }
th { color: #6b7480; font-weight: 600; } td.n { text-align: right; padding-right: 20px; }
.badge { color: #fff; border-radius: 4px; padding: 1px 8px; font-size: 13px; white-space: nowrap; }
.note { color: #6b7480; font-size: 13px; margin: 6px 0 0; }
svg { max-width: 100%; height: auto; display: block; }
"""


def page(title: str, subtitle: str, body: str) -> str:
    """A complete HTML page that loads nothing from elsewhere."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_CSS}</style></head>\n"
        f'<body><main><h1>{escape(title)}</h1><p class="sub">{escape(subtitle)}</p>\n{body}\n'
        "</main></body></html>\n"
    )


def section(title: str, content: str, note: str = "") -> str:
    """A titled box; `content` is HTML."""
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return f'<section><h2>{escape(title)}</h2><div class="scroll">{content}</div>{below}</section>\n'


def grid(sections: list[str]) -> str:
    """Boxes side by side where the page is wide enough."""
    return f'<div class="grid">{"".join(sections)}</div>\n'


def table(header: list[str], rows: list[list[str]]) -> str:
    """An HTML table; cells are HTML, the header is text."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def new_figure(width: float, height: float) -> "Figure":
    """A figure (inches) in the style of the reports; drawn without a display."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


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


def svg(figure: "Figure") -> str:
    """The figure as inline SVG."""
    stream = io.StringIO()
    figure.savefig(stream, format="svg", dpi=RASTER_DPI, metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]
