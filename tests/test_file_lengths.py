"""A module is one idea: none is longer than 400 lines."""

from onboard.kernel_cache import PACKAGES
from tests.conftest import REPOSITORY

MOST = 400


def test_no_file_is_longer_than_a_module_should_be() -> None:
    folders = (*PACKAGES, "tests", "benchmarks", "examples", "scripts")
    files = [file for folder in folders for file in (REPOSITORY / folder).rglob("*.py")]
    assert len(files) > 1000
    lengths = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in files}
    assert {file: lines for file, lines in lengths.items() if lines > MOST} == {}
