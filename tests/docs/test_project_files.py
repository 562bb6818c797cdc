"""The files at the top of the project agree with each other and with what they name."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY


def test_the_citation_is_of_this_version_and_licence() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"title: {project['name']}" in lines
    assert f"version: {project['version']}" in lines
    assert f"license: {project['license']}" in lines
    assert f"  - name: {project['authors'][0]['name']}" in lines


def test_the_hooks_run_what_make_lint_runs() -> None:
    hooks = (REPOSITORY / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    entries = re.findall(r"entry: \.venv/bin/(\w+(?: (?:check|format))?)", hooks)
    assert entries == ["ruff check", "ruff format", "mypy"]
    assert all(f"$(BIN)/{entry}" in makefile for entry in entries)


def test_what_contributors_are_told_to_run_is_there() -> None:
    told = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"`make ([a-z-]+)`", told))
    assert {"check", "lint", "test"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.mark.parametrize("finished", [False, True])
def test_an_environment_that_was_not_finished_is_made_over(tmp_path: Path, finished: bool) -> None:
    (tmp_path / "bin").mkdir()
    for made in ("python", "pip")[: 1 + finished]:
        (tmp_path / "bin" / made).touch()
    make = ["make", "--dry-run", f"VENV={tmp_path}", f"{tmp_path}/.demo"]
    planned = subprocess.run(make, cwd=REPOSITORY, check=True, capture_output=True, text=True).stdout
    assert (f"-m venv {tmp_path}" in planned) != finished


def test_every_decision_is_listed_and_short() -> None:
    folder = REPOSITORY / "docs" / "decisions"
    listed = set(re.findall(r"\]\((\w+\.md)\)", (folder / "README.md").read_text(encoding="utf-8")))
    pages = {page.name: page.read_text(encoding="utf-8") for page in folder.glob("*.md")}
    assert listed == pages.keys() - {"README.md"}
    for name in listed:
        headings = re.findall(r"^## (.*)$", pages[name], re.MULTILINE)
        assert headings == ["Context", "Decision", "Consequences"], name
        assert len(pages[name].splitlines()) <= 40, name
