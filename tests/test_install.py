"""`scripts/install.py` finds what pip would find: by uv, and by pip where uv cannot."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

INSTALL = REPOSITORY / "scripts" / "install.py"
BY_PIP = "without uv, by pip"


@pytest.fixture
def configured(tmp_path: Path) -> dict[str, str]:
    """Surroundings in which pip is told of a folder with one wheel, and of no other place."""
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    with zipfile.ZipFile(wheels / "sparrow-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("sparrow.py", "WINGS = 2\n")
        about = "sparrow-1.0.dist-info"
        wheel.writestr(f"{about}/METADATA", "Metadata-Version: 2.1\nName: sparrow\nVersion: 1.0\n")
        wheel.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"{about}/RECORD", "sparrow.py,,\n")
    configuration = tmp_path / "pip.conf"
    configuration.write_text(
        f"[global]\nfind-links = {tmp_path / 'nothing'}\nno-index = true\n[install]\nfind-links = {wheels}\n"
    )
    others = {name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "UV_"))}
    return others | {"PIP_CONFIG_FILE": str(configuration), "UV_CACHE_DIR": str(tmp_path / "cache")}


def install(surroundings: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(INSTALL), *arguments]
    return subprocess.run(command, check=False, env=surroundings, capture_output=True, text=True, timeout=120)


def test_uv_looks_where_pip_is_told_to_look(configured: dict[str, str], tmp_path: Path) -> None:
    done = install(configured, "--target", str(tmp_path / "here"), "sparrow==1.0")
    assert done.returncode == 0, done.stderr
    assert BY_PIP not in done.stderr
    assert (tmp_path / "here" / "sparrow.py").read_text() == "WINGS = 2\n"


def test_pip_does_it_where_uv_cannot(configured: dict[str, str], tmp_path: Path) -> None:
    pips_alone = ("--progress-bar", "off")
    done = install(configured, "--target", str(tmp_path / "here"), *pips_alone, "sparrow==1.0")
    assert done.returncode == 0, done.stderr
    assert BY_PIP in done.stderr
    assert (tmp_path / "here" / "sparrow.py").exists()


def test_what_neither_finds_ends_red(configured: dict[str, str], tmp_path: Path) -> None:
    assert install(configured, "--target", str(tmp_path / "here"), "sparrow==2.0").returncode != 0
