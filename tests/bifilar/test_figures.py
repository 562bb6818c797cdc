"""The figures of a report can be drawn from any result."""

import numpy as np
import pytest

from calibration.bench.inertia.figures import budget_figure, swing_figure, trials_figure
from calibration.bench.inertia.fit import fit_swing
from calibration.bench.inertia.inertia import inertia_about_axis
from calibration.bench.inertia.rig import Rig, measured
from calibration.bench.inertia.swing_fit import SwingFit
from calibration.report_style import svg
from tests.truth.bench.pendulum import Hang, record


@pytest.fixture(scope="module")
def fits() -> list[SwingFit]:
    return [
        fit_swing(record(Hang(), np.random.default_rng(k), 10.0, cycles=12.0, rate_hz=50.0)) for k in range(4)
    ]


def test_all_figures_become_svg(fits: list[SwingFit]) -> None:
    separation, length = measured([0.06], 1e-4, "m"), measured([0.6], 5e-4, "m")
    result = inertia_about_axis(fits, Rig(measured([0.034], 2e-5, "kg"), separation, separation, length))
    for figure in (swing_figure(fits[0]), trials_figure(fits), budget_figure(result)):
        assert svg(figure, "a figure").startswith("<svg")


def test_the_budget_names_what_to_measure_better(fits: list[SwingFit]) -> None:
    wide, length = measured([0.06], 5e-4, "m"), measured([0.6], 5e-4, "m")
    figure = budget_figure(inertia_about_axis(fits, Rig(measured([0.034], 2e-5, "kg"), wide, wide, length)))
    assert "use a printed jig" in figure.axes[0].get_title(loc="left")
    assert figure.axes[0].get_yticklabels()[0].get_text() == "string distance"
