"""What was measured goes into a lab file, and the rest of its text stays."""

from dataclasses import replace
from pathlib import Path

import pytest

from onboard.lab_file import Ceiling, LabFile, LabFileError, SubjectToBody, put_measured
from onboard.quantity import Quantity
from perchhw.lab import read_lab
from perchhw.lab.flying import LIMITS
from tests.conftest import REPOSITORY

SOURCE = "measured here"
DOCUMENTED = (REPOSITORY / "docs" / "lab_file.md").read_text(encoding="utf-8")
WHOLE = DOCUMENTED.split("```toml\n")[1].split("```")[0]
"""The whole file of the page: the ceiling has tables of its own, the rest is inline."""


def metre(value: float) -> Quantity:
    return Quantity(value, "m", 0.001, SOURCE)


def measured(lab: LabFile, height: float = 2.5) -> LabFile:
    return replace(
        lab,
        room=replace(lab.room, ceiling=Ceiling(height=metre(height))),
        mocap=replace(
            lab.mocap,
            subject_to_body=SubjectToBody(position=(metre(0.01), metre(-0.02), metre(0.03))),
            latency_s=Quantity(0.007, "s", 0.002, SOURCE),
        ),
    )


def test_the_page_s_file_keeps_its_remarks_and_says_what_was_measured(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(WHOLE, encoding="utf-8")
    lab = measured(read_lab(file))
    put_measured(file, lab, LIMITS)
    text = file.read_text(encoding="utf-8")
    assert read_lab(file) == lab
    assert "# walls of the volume that may be flown in" in text
    assert "wand on nine points" not in text
    kept = [line for line in WHOLE.splitlines() if "ceiling" not in line and "latency" not in line]
    assert len([line for line in kept if line in text.splitlines()]) >= len(kept) - 8
    put_measured(file, lab, LIMITS)
    assert file.read_text(encoding="utf-8") == text


def test_a_file_without_the_optional_keys_gets_them(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    lines = [line for line in WHOLE.splitlines() if not line.startswith(("subject_to_body", "latency_s"))]
    file.write_text("\n".join(lines), encoding="utf-8")
    lab = measured(read_lab(file))
    put_measured(file, lab, LIMITS)
    assert read_lab(file) == lab


@pytest.mark.parametrize("height", [4.5, 2.5])
def test_what_cannot_be_said_leaves_the_file_and_shows_the_lines(height: float, tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    # A position over several lines is TOML, and not what this changes.
    text = (
        WHOLE
        if height > 4.0
        else WHOLE.replace("position = [0.0, 0.0, -0.031]", "position = [\n0.0, 0.0, 0.0]")
    )
    file.write_text(text, encoding="utf-8")
    lab = measured(read_lab(file), height)
    with pytest.raises(LabFileError) as refused:
        put_measured(file, lab, LIMITS)
    assert f"{file}: " in str(refused.value)
    assert f"ceiling = {{ height = {{ value = {height}" in str(refused.value)
    assert file.read_text(encoding="utf-8") == text
    assert list(tmp_path.iterdir()) == [file]
