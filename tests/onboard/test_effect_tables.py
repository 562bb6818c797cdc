"""The tables that say what a vehicle file may say of an effect: read, and refused by file and table."""

from pathlib import Path

import pytest

from onboard.vehicle.effects import Domain
from onboard.vehicle.effects.tables import EffectFileError, read_effects

HEAVE_DRAG = """
[heave_drag]
domain = "air"
equation = "f_z = -coefficient |u_z| u_z"
revealed_by = "fast climbs and descents"
reference = "Hoerner, Fluid-Dynamic Drag, 1965"

[heave_drag.parameters.coefficient]
unit = "N s2/m2"
low = 0
high = 0.2
typical = 0.01
practical_minimum = 0.002
meaning = "drag along z"
source = "engineering estimate"
grows = { mass = 1 }
"""


def test_the_table_of_an_effect(tmp_path: Path) -> None:
    (tmp_path / "air.toml").write_text(HEAVE_DRAG)
    effect = read_effects([tmp_path / "air.toml"])["heave_drag"]
    assert effect.domain is Domain.AIR
    assert effect.parameters["coefficient"].grows == {"mass": 1.0}
    assert effect.parameters["coefficient"].neutral is None


@pytest.mark.parametrize(
    ("line", "instead", "expected"),
    [
        ('source = "engineering estimate"\n', "", "air.toml: [heave_drag] coefficient: source is missing"),
        ('equation = "f_z = -coefficient |u_z| u_z"\n', "", "air.toml: [heave_drag]: equation is missing"),
        ("source =", "sorce =", "[heave_drag] coefficient.sorce: unknown key; did you mean 'source'?"),
        (
            '"air"',
            '"airs"',
            "[heave_drag]: domain must be one of actuation, air, rigid_body, contact, sensing",
        ),
        ("typical = 0.01", 'typical = "0.01"', "coefficient: typical must be a number, not '0.01'"),
        ("low = 0", "low = nan", "coefficient: low must be a number, not nan"),
        ("mass = 1", "weight = 1", "grows must be a table of powers of mass, arm, radius, rotor_speed"),
        ("grows = { mass = 1 }", "grows = 1", "grows must be a table of powers of mass"),
        ('domain = "air"', 'domain = "air"\nneeds = ["legs", "arms"]', "needs must be a list out of legs"),
        ('domain = "air"', 'domain = "air"\nby_forces = 1', "by_forces must be true or false, not 1"),
        ('domain = "air"', 'domain = "air"\nexcludes = "wind"', "excludes must be a list of texts"),
        ("parameters.coefficient]", "parameter.coefficient]", "[heave_drag]: needs its parameters"),
        (
            "[heave_drag.parameters",
            '[heave_drag.parameters."coefficient z"]\n[heave_drag.parameters',
            "z: unit",
        ),
        (
            HEAVE_DRAG,
            HEAVE_DRAG + "[heave_drag]\n",
            "is not valid TOML: Cannot declare ('heave_drag',) twice",
        ),
        (
            HEAVE_DRAG,
            HEAVE_DRAG.replace(".coefficient]", '."x x"]'),
            "[heave_drag] x x: x has a table already",
        ),
        (HEAVE_DRAG, "heave_drag = 1", "air.toml: heave_drag: must be a table, not int"),
    ],
)
def test_a_mistake_in_the_table_of_an_effect_is_told_by_file_and_table(
    line: str, instead: str, expected: str, tmp_path: Path
) -> None:
    assert line in HEAVE_DRAG
    (tmp_path / "air.toml").write_text(HEAVE_DRAG.replace(line, instead))
    with pytest.raises(EffectFileError) as caught:
        read_effects([tmp_path / "air.toml"])
    assert expected in str(caught.value)


def test_an_effect_is_in_one_file(tmp_path: Path) -> None:
    files = [tmp_path / "air.toml", tmp_path / "contact.toml"]
    for file in files:
        file.write_text(HEAVE_DRAG)
    with pytest.raises(EffectFileError, match=r"contact.toml: \[heave_drag\] is in air.toml already"):
        read_effects(files)
