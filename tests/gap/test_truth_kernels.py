"""The kernels of hidden worlds are compiled anew when a file that they take something from changes."""

import importlib
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests import truth
from tests.truth import hidden_effects, landings

WORLDS, NAMES = [hidden_effects, landings, truth], ["flights", "landings", "programs"]

CALLED = "from {name}.jit import jitted\n\n@jitted\ndef called(x):\n    return x + {added}\n"
CALLER = (
    "from {name}.jit import jitted\nfrom {name}.called import called\n\n"
    "@jitted\ndef caller(x):\n    return 10.0 * called(x)\n"
)


def call(package: str) -> float:
    """The kernel's answer as a new process gets it: from disk where it is kept, compiled otherwise."""
    for module in [module for module in sys.modules if module.partition(".")[0] == package]:
        del sys.modules[module]
    importlib.invalidate_caches()
    return float(importlib.import_module(f"{package}.caller").caller(1.0))


@pytest.mark.parametrize("world", WORLDS, ids=NAMES)
def test_a_kernel_follows_what_it_calls_in_another_file(
    world: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / f"kept_kernels_{world.__name__.rpartition('.')[2]}"
    folder.mkdir()
    shutil.copy(Path(str(world.__file__)).with_name("jit.py"), folder / "jit.py")
    (folder / "caller.py").write_text(CALLER.format(name=folder.name))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for added, expected in ((1.0, 20.0), (2.0, 30.0)):
        (folder / "called.py").write_text(CALLED.format(name=folder.name, added=added))
        assert call(folder.name) == expected


@pytest.mark.parametrize("world", WORLDS, ids=NAMES)
def test_every_kernel_of_a_hidden_world_is_kept_so(world: ModuleType) -> None:
    files = [*Path(str(world.__file__)).parent.glob("*.py")]
    assert any("@jitted" in file.read_text(encoding="utf-8") for file in files)
    for file in files:
        assert "njit" not in file.read_text(encoding="utf-8"), file
