"""Whatever is broken: a fit with findings, or an error of ours."""

import math

import numpy as np
import pytest

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.bench.inertia.fit import fit_swing
from tests.bifilar.damage import damaged
from tests.truth.bench.pendulum import Hang, record


@pytest.mark.parametrize("block", range(4))
def test_damaged_recordings_are_fitted_or_refused(block: int) -> None:
    for k in range(8):
        rng = np.random.default_rng([block, k])
        whole = record(Hang(), rng, rng.uniform(1.0, 30.0), cycles=rng.uniform(1.0, 12.0), rate_hz=50.0)
        try:
            fit = fit_swing(damaged(whole, rng))
        except UnusableSwingError:
            continue
        assert math.isfinite(fit.period.value)
        assert fit.period.value > 0.0
