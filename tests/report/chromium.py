"""Pages in a real browser, where there is one: how wide they are, what they say and load."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

WIDTHS = (1400, 400)
_PROBE = """<!DOCTYPE html><html><body>FRAMES<script>
const found = [];
const frames = [...document.querySelectorAll('iframe')];
function look(frame) {
  const page = frame.contentDocument, width = frame.clientWidth;
  const shown = [...page.querySelectorAll('body *')].filter(e => e.getClientRects().length);
  const beyond = shown.filter(e => e.getBoundingClientRect().right > width + 1)
    .filter(e => !e.closest('svg') || e.tagName === 'svg');
  found.push({
    page: frame.dataset.page, width: width, wide: page.documentElement.scrollWidth,
    beyond: beyond.slice(0, 5).map(e => e.tagName + ': ' + e.textContent.slice(0, 60)),
    scrolled: shown.filter(e => e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0)
      .slice(0, 5).map(e => e.tagName + ': ' + e.textContent.slice(0, 60)),
    loaded: frame.contentWindow.performance.getEntriesByType('resource').map(e => e.name),
    pictures: page.querySelectorAll('svg').length,
  });
}
window.onload = () => {
  frames.forEach(look);
  const told = document.createElement('pre');
  told.id = 'found';
  told.textContent = JSON.stringify(found);
  document.body.replaceChildren(told);
};
</script></body></html>"""


@dataclass(frozen=True)
class Shown:
    """A page as the browser showed it at one width.

    Attributes:
        page: its file.
        width: of the window, px.
        wide: what the page takes, px.
        beyond: elements that reach beyond the right edge.
        scrolled: elements that hold more than they show.
        loaded: what it loaded besides itself.
        pictures: number of its pictures.
    """

    page: str
    width: int
    wide: int
    beyond: list[str]
    scrolled: list[str]
    loaded: list[str]
    pictures: int


def chromium() -> str:
    """The browser, or the test is skipped."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if (found := shutil.which(name)) is not None:
            return found
    pytest.skip("no chromium here to show the pages with (apt install chromium)")


def show(pages: list[Path], folder: Path) -> tuple[list[Shown], list[str]]:
    """Every page at every width, and what the console said; one start of the browser."""
    browser = chromium()
    frames = "".join(
        f'<iframe data-page="{page.name}" src="{page.as_uri()}" '
        f'style="border:0;width:{width}px;height:900px"></iframe>'
        for page in pages
        for width in WIDTHS
    )
    probe = folder / "probe.html"
    probe.write_text(_PROBE.replace("FRAMES", frames), encoding="utf-8")
    command = [
        browser,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--allow-file-access-from-files",
        "--disable-background-networking",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={folder / 'profile'}",
        "--enable-logging=stderr",
        "--window-size=1500,1000",
        "--virtual-time-budget=10000",
        "--dump-dom",
        probe.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=250)
    told = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told is not None, done.stdout[-2000:]
    found: list[dict[str, Any]] = json.loads(told.group(1).replace("&amp;", "&").replace("&lt;", "<"))
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return [Shown(**one) for one in found], console


def assert_they_fit(pages: list[Path], folder: Path) -> list[Shown]:
    """No word on the console, nothing loaded, and nothing wider than the page, at every width."""
    seen, console = show(pages, folder)
    assert console == []
    assert [one.width for one in seen] == [*WIDTHS] * len(pages)
    for one in seen:
        assert one.wide <= one.width, one
        assert (one.beyond, one.scrolled, one.loaded) == ([], [], []), one
    return seen
