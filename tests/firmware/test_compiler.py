"""Finding a compiler, compiling once, and what is said where that does not work."""

from pathlib import Path

import pytest

from onboard.firmware import compiler
from onboard.firmware.compiler import CompilationFailed, NoCompiler, compiled_library, find_compiler
from onboard.firmware.library import CoreLibrary
from perchhw.cli.main import run
from sim_backend.engine_name import EngineName, usable_engine

QUICK = ("-O0",)
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))


@pytest.mark.parametrize("verb", [["sim", "lab"], ["sim", "drone"], ["demo"]])
def test_the_engine_in_c_without_a_compiler_says_what_to_install(
    verb: list[str], no_compiler: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*verb, "--engine", "c"]) == 2
    said = capsys.readouterr().err
    assert "apt install gcc" in said
    assert "--engine reference" in said


def test_without_a_compiler_the_reference_flies(no_compiler: None) -> None:
    assert usable_engine(None) is EngineName.REFERENCE
    assert usable_engine(EngineName.REFERENCE) is EngineName.REFERENCE
    with pytest.raises(NoCompiler):
        compiled_library()


@needs_compiler
def test_with_a_compiler_the_drones_own_code_flies() -> None:
    assert usable_engine(None) is EngineName.C
    assert usable_engine(EngineName.REFERENCE) is EngineName.REFERENCE


@needs_compiler
def test_a_library_is_compiled_once_with_the_same_flags(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = compiled_library()
    made = first.stat().st_mtime_ns
    assert CoreLibrary(first).core_bytes > 0
    assert compiled_library() == first
    assert first.stat().st_mtime_ns == made
    assert [path.name for path in first.parent.iterdir()] == [first.name]
    assert compiled_library(QUICK) != first


@needs_compiler
def test_sources_that_do_not_compile_say_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(CompilationFailed, match="no-such-flag"):
        compiled_library(("--no-such-flag",))
    assert not list(tmp_path.rglob("*.so"))


@pytest.mark.further
@needs_compiler
def test_old_libraries_make_room(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compiler, "KEPT", 1)
    made = [compiled_library((*QUICK, f"-DSTATE={i}")) for i in range(3)]
    assert [path.exists() for path in made] == [False, True, True]
