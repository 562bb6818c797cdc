"""A number of a named effect, as the report has it."""

import pytest

from calibration.gap.estimate.model import Model, Variable
from calibration.gap.report.proof import found_parameters
from calibration.gap.report.words import parameter
from calibration.gap.search.naming import Named
from onboard.json_file import as_json
from onboard.vehicle import load_vehicle

STOCK = load_vehicle("crazyflie21-stock")
X, Z = Variable("com_offset", "x"), Variable("com_offset", "z")
HIGH = Model(STOCK).rule(Z).high


def named(error_z: float) -> Named:
    model = Model(STOCK, {X: 1e-3, Z: 0.2 * HIGH})
    return Named(("com_offset",), (), model, model, {X: 1e-5, Z: error_z}, {}, (), {})


def test_an_interval_that_holds_all_that_is_physical_says_that_nothing_was_seen() -> None:
    x, z = (found_parameters("com_offset", named(HIGH))[axis] for axis in "xz")
    assert (x.unseen, z.unseen) == (False, True)
    assert "unseen" not in as_json(x)
    assert as_json(z)["unseen"] is True
    assert parameter("z", z).endswith("these flights do not tell)")
    assert "do not tell" not in parameter("x", x)


@pytest.mark.parametrize("error", [0.3 * HIGH, 0.6 * HIGH])
def test_what_rules_out_one_end_was_seen(error: float) -> None:
    """0.2 of the bound less 1.96 times 0.6 of it is short of the lower one, though beyond the upper."""
    assert not found_parameters("com_offset", named(error))["z"].unseen
