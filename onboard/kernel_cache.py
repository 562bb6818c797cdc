"""Compiled kernels are kept in a folder named after the source they were compiled from.

Numba caches a kernel under the time stamp of its own file, and does not see that a function that it calls
from another file has changed: after an update of the project, old physics would go on flying. With a folder
of its own for each state of the source, an update compiles anew, once.

The source of the kernels is found, not listed: the files that import numba or one of the two ``jit.py``,
and all of ours that these import in turn, for a kernel takes functions and constants from there. Commands
without kernels do not look for it: the rule is applied where numba is imported.

In the place of a folder that cannot be written numba would take one beside the source, and go by time stamps
again: the process and those that it starts get a folder of their own then, for as long as they run.
"""

import hashlib
import os
import platform
import re
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import IO

from onboard.user_cache import cache_for_compiled, keep_for_now, user_cache

try:
    import fcntl
except ImportError:  # Windows: two processes may compile the same
    fcntl = None  # type: ignore[assignment]

PACKAGES = ("onboard", "mocap_bridge", "sim_backend", "calibration", "perchhw")

KEPT = 4
"""States of the source whose kernels are kept beside the present one, for those who switch branches."""

VARIABLE = "NUMBA_CACHE_DIR"

_ASK_EVERY_S = 0.05
"""How often somebody who waits for a kernel looks whether it is there."""

_TICK_S = 2.0
"""A file that was written so short a time ago may be written again without a trace in its times."""

_NUMBA = re.compile(rb"^[ \t]*(?:from|import)[ \t]+numba\b", re.MULTILINE)
_FROM = re.compile(rb"^[ \t]*from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)", re.MULTILINE)
_IMPORT = re.compile(rb"^[ \t]*import[ \t]+([^\n]*)", re.MULTILINE)
_FOR_TYPES = re.compile(rb"^if TYPE_CHECKING:\n(?:[ \t]+[^\n]*\n|\n)+", re.MULTILINE)
_COMMENT = re.compile(rb"#[^\n]*")


class _Source:
    """The modules of the packages below a folder, by their dotted names, and what they import."""

    def __init__(self, root: Path) -> None:
        self.paths: dict[str, Path] = {}
        self.texts: dict[str, bytes] = {}
        for package in PACKAGES:
            for folder, _, files in os.walk(root / package):  # in a fifth of the time of Path.rglob
                name = os.path.relpath(folder, root).replace(os.sep, ".")
                for file in files:
                    if file.endswith(".py"):
                        module = name if file == "__init__.py" else f"{name}.{file[:-3]}"
                        self.paths[module] = path = Path(folder, file)
                        self.texts[module] = path.read_bytes()

    def imports(self, module: str) -> Iterator[str]:
        """Modules of ours that a module imports, each with the packages that it is in."""
        text = self.texts[module]
        if b"TYPE_CHECKING" in text:
            text = _FOR_TYPES.sub(b"", text)  # nothing of it is there when the program runs
        for match in _FROM.finditer(text):
            origin = match[1].decode()
            for name in _names(match[2]):
                yield from self._with_packages(f"{origin}.{name}")
        for match in _IMPORT.finditer(text):
            for name in _names(match[1]):
                yield from self._with_packages(name)

    def _with_packages(self, name: str) -> Iterator[str]:
        while name:
            if name in self.paths:
                yield name
            name = name.rpartition(".")[0]

    def of_kernels(self) -> list[str]:
        """The modules of kernels and all that they import, sorted."""
        # Most files do not even name what is looked for: a search for the word takes a tenth of the time.
        doors = {
            module
            for module, text in self.texts.items()
            if module.endswith(".jit") or (b"numba" in text and _NUMBA.search(text))
        }
        names = [door.rpartition(".")[2].encode() for door in doors]
        waiting = [
            module
            for module, text in self.texts.items()
            if module in doors
            or (any(name in text for name in names) and not doors.isdisjoint(self.imports(module)))
        ]
        found: set[str] = set()
        while waiting:
            module = waiting.pop()
            if module not in found:
                found.add(module)
                waiting.extend(self.imports(module))
        return sorted(found)


def _names(listed: bytes) -> list[str]:
    """The names in a list of imports, without what they are imported as."""
    parts = (part.split() for part in _COMMENT.sub(b"", listed).strip(b"()").split(b","))
    return [part[0].decode() for part in parts if part]


def kernel_sources(root: Path) -> list[Path]:
    """The files below `root` that kernels are in, and what they take functions and constants from."""
    source = _Source(root)
    return [source.paths[module] for module in source.of_kernels()]


def source_key(root: Path) -> str:
    """Twelve hexadecimal digits that change with any source file of a kernel below `root`."""
    digest, source = hashlib.sha256(), _Source(root)
    for module in source.of_kernels():
        digest.update(module.encode() + b"\0" + source.texts[module] + b"\0")
    return digest.hexdigest()[:12]


def use_cache_of_this_source() -> None:
    """Point numba to the folder of the present source, unless ``NUMBA_CACHE_DIR`` is set already."""
    if VARIABLE in os.environ:
        keep_for_now(Path(os.environ[VARIABLE]))
        return
    parent = user_cache()
    name = f"kernels-{_key_of_this_source()}"
    if not (parent / name).exists():
        _make_room(parent)
    os.environ[VARIABLE] = folder = str(cache_for_compiled(name))
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder


@contextmanager
def compiling(kernel: str) -> Iterator[None]:
    """While one process compiles a kernel, by its dotted name, others wait, and find it in the cache.

    Nobody waits for a process that is suspended, as by Ctrl-Z: the kernel is compiled twice then.
    """
    folder = Path(os.environ[VARIABLE])
    with ExitStack() as stack:
        if fcntl is not None:
            with suppress(OSError):  # a cache that cannot be written holds nothing to wait for
                folder.mkdir(parents=True, exist_ok=True)
                lock = stack.enter_context((folder / f"{kernel}.lock").open("ab+", buffering=0))
                _hold(lock)
        yield


def _hold(lock: IO[bytes]) -> None:
    """Wait for a lock and write into it who has it, or go on without where that process is suspended."""
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            holder = lock.read()
            if holder.isdigit() and _suspended(int(holder)):
                return
            time.sleep(_ASK_EVERY_S)
        else:
            lock.truncate(0)
            lock.write(str(os.getpid()).encode())
            return


def _suspended(process: int) -> bool:
    """Whether a process of this machine is stopped; False where nobody can tell."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state in ("T", "t")


def is_complete(kernels: str) -> bool:
    """Whether a process has noted that all of these kernels are in the present cache."""
    return _note(kernels).exists()


def note_complete(kernels: str) -> None:
    """Note for later processes that a set of kernels, by its name, is in the present cache; a disk that takes
    no note costs them the time to look."""
    note = _note(kernels)
    with suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True)
        note.touch()


def _note(kernels: str) -> Path:
    """File whose presence says it; numba keeps kernels apart by the same things."""
    import llvmlite.binding

    parts = (
        _key_of_this_source(),
        platform.python_version(),
        version("numba"),
        llvmlite.binding.get_host_cpu_name(),
    )
    return Path(os.environ[VARIABLE]) / f"{kernels}-{'-'.join(parts)}.complete"


@cache
def _key_of_this_source() -> str:
    """Read in a tenth of a second, or taken from a note of the process that read these very files."""
    root = Path(__file__).resolve().parents[1]
    note = user_cache() / "sources" / hashlib.sha256(bytes(root)).hexdigest()[:12]
    state, youngest = _state_of_files(root)
    with suppress(OSError, ValueError):
        noted, key = note.read_text().split()
        if noted == state:
            return key
    key = source_key(root)
    if youngest < time.time() - _TICK_S:
        with suppress(OSError):  # without a note the source is read each time
            note.parent.mkdir(parents=True, exist_ok=True)
            draft = note.with_suffix(f".{os.getpid()}")
            try:
                draft.write_text(f"{state} {key}\n")
                draft.replace(note)
            finally:
                draft.unlink(missing_ok=True)  # of a disk that is full
    return key


def _state_of_files(root: Path) -> tuple[str, float]:
    """Digits that change whenever a source file is written or put in place of another, and when (s) the last
    was. A file's time of change, other than that of its content, is the system's: nobody sets it back."""
    digest, youngest = hashlib.sha256(), 0.0
    for package in PACKAGES:
        for folder, _, files in os.walk(root / package):
            for path in (Path(folder, file) for file in files if file.endswith(".py")):
                about = path.stat()
                times = f"{about.st_mtime_ns} {about.st_ctime_ns}"
                digest.update(f"{path}\0{about.st_size} {times}\0".encode())
                youngest = max(youngest, about.st_ctime)
    return digest.hexdigest()[:32], youngest


def _make_room(parent: Path) -> None:
    """Drop the kernels of all but the `KEPT` youngest states of the source."""
    by_age = sorted(parent.glob("kernels-*"), key=_written)
    for folder in by_age[:-KEPT]:
        shutil.rmtree(folder, ignore_errors=True)


def _written(folder: Path) -> float:
    """When (s); the beginning of time for one that another process has dropped meanwhile."""
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0
