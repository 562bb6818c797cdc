"""Compiled kernels are kept in a folder named after the source they were compiled from.

Numba caches a kernel under the time stamp of its own file, and does not see that a function that it calls
from another file has changed: after an update of the project, old physics would go on flying. With a folder
of its own for each state of the source, an update compiles anew, once.
"""

import hashlib
import os
import shutil
import sys
from pathlib import Path

KERNEL_SOURCES = (
    "onboard/**/*.py",
    "sim_backend/physics/**/*.py",
    "sim_backend/crazyflie/*.py",
    "perchhw/learning/*.py",
)
"""Where kernels are, and what they take constants from."""

KEPT = 4
"""States of the source whose kernels are kept beside the present one, for those who switch branches."""

VARIABLE = "NUMBA_CACHE_DIR"


def source_key(root: Path) -> str:
    """Twelve hexadecimal digits that change with any source file of a kernel below `root`."""
    digest = hashlib.sha256()
    for pattern in KERNEL_SOURCES:
        for path in sorted(root.glob(pattern)):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def use_cache_of_this_source() -> None:
    """Point numba to the folder of the present source, unless ``NUMBA_CACHE_DIR`` is set already."""
    if VARIABLE in os.environ:
        return
    parent = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "perchhw"
    folder = parent / f"kernels-{source_key(Path(__file__).resolve().parents[1])}"
    if not folder.exists():
        _make_room(parent)
    os.environ[VARIABLE] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)


def _make_room(parent: Path) -> None:
    """Drop the kernels of all but the `KEPT` youngest states of the source."""
    by_age = sorted(parent.glob("kernels-*"), key=lambda folder: folder.stat().st_mtime)
    for folder in by_age[:-KEPT]:
        shutil.rmtree(folder, ignore_errors=True)
