"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data (the authors' flights, public flights, bench logs), kept beside the project.

    ``PERCHHW_SHARED_DATA`` overrides the place. Tests that need it skip where it is absent.
    """
    folder = Path(os.environ.get("PERCHHW_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
    if not (folder / "README.md").is_file():
        pytest.skip(f"real data not found at {folder}; set PERCHHW_SHARED_DATA to the folder with habas2022/")
    return folder
