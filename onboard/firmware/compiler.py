"""Compiling the core with the user's own C compiler, into the user's cache.

A library is named after the sources, the flags and the compiler that it comes from: whoever changes one of
them compiles anew, once.
"""

import errno
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from onboard.errors import InputError, OnboardError
from onboard.user_cache import cache_for_compiled

SOURCES = Path(__file__).parent

COMPILERS = ("cc", "gcc", "clang")
"""Names of C compilers, the first that is found on PATH is taken."""

FLAGS = (
    "-std=c11",
    "-O2",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wconversion",
    "-Wdouble-promotion",
)
"""As on the drone: without fused multiply-adds, whose results differ in the last place."""

KEPT = 4
"""Libraries of earlier states of the sources that are kept, for those who switch branches."""


class NoCompiler(OnboardError, InputError):
    """There is no C compiler."""


class CompilationFailed(OnboardError):
    """The core does not compile here; the message has what the compiler said."""


def find_compiler() -> str | None:
    """The path of the C compiler, or None."""
    return next((path for name in COMPILERS if (path := shutil.which(name))), None)


def needed_compiler() -> str:
    """:func:`find_compiler`.

    Raises:
        NoCompiler: there is none; with what to install.
    """
    path = find_compiler()
    if path is None:
        raise NoCompiler(
            f"the drone's code in C needs a C compiler, and none of {', '.join(COMPILERS)} is on the PATH: "
            "install one (Debian, Ubuntu: apt install gcc libc6-dev), or take --engine reference"
        )
    return path


def c_files() -> list[Path]:
    """The sources, headers included, in a fixed order."""
    return sorted(path for folder in ("core", "host") for path in (SOURCES / folder).glob("*.[ch]"))


def compiled_library(extra_flags: Sequence[str] = ()) -> Path:
    """The shared library of the present sources, compiled if it is not in the cache yet.

    Args:
        extra_flags: further flags, of sanitizers for example.

    Raises:
        NoCompiler, CompilationFailed.
    """
    compiler, flags = needed_compiler(), (*FLAGS, *extra_flags)
    folder = cache_for_compiled("core")
    library = folder / f"{_key(compiler, flags)}.so"
    if not library.exists():
        try:
            _compile(compiler, flags, library)
            _make_room(folder, library)
        except OSError as error:
            raise CompilationFailed(f"{library}: the drone's code cannot be compiled ({error})") from error
    return library


def _key(compiler: str, flags: Sequence[str]) -> str:
    digest = hashlib.sha256("\0".join((str(Path(compiler).resolve()), *flags)).encode())
    for path in c_files():
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _compile(compiler: str, flags: Sequence[str], library: Path) -> None:
    """Compile under another name first: of several processes at once, each finds a whole library or none."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        made = Path(folder, library.name)
        sources = [str(path) for path in c_files() if path.suffix == ".c"]
        command = [compiler, *flags, "-fPIC", "-shared", *sources, "-lm", "-o", str(made)]
        english = {**os.environ, "LC_ALL": "C"}
        said = subprocess.run(command, capture_output=True, text=True, check=False, env=english)
        if os.strerror(errno.ENOSPC) in said.stderr:
            raise CompilationFailed(
                f"the disk is full on which the drone's code in C is compiled: make room in {library.parent} "
                f"and {tempfile.gettempdir()}, or take --engine reference"
            )
        if said.returncode != 0:
            raise CompilationFailed(
                f"the drone's code in C does not compile with {compiler}; take --engine reference, and "
                f"report what it said:\n{said.stderr.strip()}"
            )
        made.replace(library)


def _make_room(folder: Path, newest: Path) -> None:
    """Drop all but the youngest libraries."""
    with suppress(OSError):  # another process may be at it
        others = sorted(folder.glob("*.so"), key=lambda path: path.stat().st_mtime)
        for path in others[: -KEPT - 1]:
            if path != newest:
                path.unlink(missing_ok=True)
