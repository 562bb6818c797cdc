"""What docs/troubleshooting.md says that one sees is what the code says."""

import re

import pytest

from tests.conftest import REPOSITORY

PAGE = (REPOSITORY / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
PACKAGES = ("perchhw", "onboard", "mocap_bridge", "sim_backend")


def symptoms() -> list[str]:
    """Code in the first column of the tables; ``...`` and numbers stand for what differs."""
    rows = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("|")]
    return sorted({code for row in rows for code in re.findall(r"`([^`]+)`", row)})


@pytest.fixture(scope="module")
def sources() -> str:
    files = (file for package in PACKAGES for file in (REPOSITORY / package).rglob("*.py"))
    return "\n".join(file.read_text(encoding="utf-8") for file in files).lower()


def test_every_symptom_is_said_by_the_code(sources: str) -> None:
    named = symptoms()
    assert len(named) > 20
    known_elsewhere = {"NO_COLOR", "nohup"}
    missing = [
        symptom
        for symptom in named
        if symptom not in known_elsewhere
        and not all(part.lower() in sources for part in re.split(r"\.\.\.| N\b|: ", symptom) if part)
    ]
    assert missing == []
