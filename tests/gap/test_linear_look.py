"""A linear look at an exchange of names tells what would do as well from what would not."""

import pytest

from calibration.gap.search.linear_look import linear_look
from tests.gap.test_exchange import SCALE, fitted, training


def test_what_a_name_explains_and_what_would_do_as_well() -> None:
    scaled, none = fitted(SCALE), fitted()
    look = linear_look(scaled, training(), {"mass_error", "motor_imbalance", "thrust_curve"})
    alone = look.lacks(["thrust_scale"])[1]
    assert alone > float(scaled.gains(none, in_time=True).sum())  # under the noise of the fit that has it
    assert look.lacks(["thrust_scale"], "thrust_curve")[1] > 0.75 * alone
    assert abs(look.lacks(["thrust_scale"], "motor_imbalance")[1]) < 0.02 * alone
    assert look.lacks([])[1] == pytest.approx(0.0, abs=1e-6)
