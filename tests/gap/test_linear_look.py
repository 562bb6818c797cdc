"""A linear look at an exchange of names tells what would do as well from what would not."""

from typing import Any

import numpy as np
import pytest

from calibration.gap.search.linear_look import linear_look
from calibration.gap.search.screen import held_out
from onboard.arrays import FloatArray
from tests.gap.test_exchange import SCALE, fitted, training


def test_what_a_name_explains_and_what_would_do_as_well() -> None:
    scaled, none = fitted(SCALE), fitted()
    look = linear_look(scaled, training(), {"mass_error", "motor_imbalance", "thrust_curve"})
    alone = look.lacks(["thrust_scale"])[1]
    assert alone > float(scaled.gains(none, in_time=True).sum())  # under the noise of the fit that has it
    assert look.lacks(["thrust_scale"], "thrust_curve")[1] > 0.75 * alone
    assert abs(look.lacks(["thrust_scale"], "motor_imbalance")[1]) < 0.02 * alone
    assert look.lacks([])[1] == pytest.approx(0.0, abs=1e-6)


def test_an_exchange_is_fitted_once_however_often_it_is_asked_about(monkeypatch: pytest.MonkeyPatch) -> None:
    fits: list[None] = []

    def counted(*given: Any) -> FloatArray:
        fits.append(None)
        return held_out(*given)

    look = linear_look(fitted(SCALE), training(), {"mass_error"})
    monkeypatch.setattr("calibration.gap.search.linear_look.held_out", counted)
    lacks = [look.lacks(["thrust_scale"], other) for other in (None, "mass_error", None, "mass_error")]
    assert len(fits) == 3  # all of the fit, without the name, with the other in its place
    np.testing.assert_array_equal(lacks[:2], lacks[2:])
    assert not np.array_equal(lacks[0], lacks[1])
