"""What pip installs is whole, and flies: built and put into a folder of its own, as for a stranger."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.kernel_cache import PACKAGES
from tests.conftest import REPOSITORY


def files_of(folder: Path) -> set[Path]:
    """All files of the packages in `folder`, relative to it."""
    found = (file for package in PACKAGES for file in (folder / package).rglob("*") if file.is_file())
    return {file.relative_to(folder) for file in found if "__pycache__" not in file.parts}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a wheel is built of, without what earlier builds have left."""
    folder = tmp_path_factory.mktemp("source")
    for package in PACKAGES:
        compiled = shutil.ignore_patterns("__pycache__")
        shutil.copytree(REPOSITORY / package, folder / package, ignore=compiled)
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / file, folder)
    return folder


@pytest.fixture(scope="module")
def installed(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel, which has nothing to do with the sources.

    The tool that builds it comes from where `make` has got it for the same purpose: uv has kept it.
    """
    target = tmp_path_factory.mktemp("wheel")
    install = [sys.executable, str(REPOSITORY / "scripts" / "install.py"), "--no-deps"]
    subprocess.run(
        [*install, "--target", str(target), str(source)], check=True, env=os.environ | {"UV_OFFLINE": "1"}
    )
    return target


@pytest.mark.further
def test_a_wheel_has_every_file_of_the_packages(source: Path, installed: Path) -> None:
    assert Path("calibration/firmware/tachometer/tachometer.ino") in files_of(installed)
    assert files_of(installed) == files_of(source)


@pytest.mark.further
def test_a_wheel_flies(installed: Path, tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(installed), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    environment.pop("NUMBA_CACHE_DIR", None)
    folder = tmp_path / "empty"
    folder.mkdir()

    def python(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    for package in PACKAGES:
        found = Path(python("-c", f"import {package}; print({package}.__file__)").strip())
        assert found.is_relative_to(installed)
    (flown,) = json.loads(python("-m", "perchhw", "--json", "demo", "--attempts", "1"))["attempts"]
    assert flown["triggered"]
