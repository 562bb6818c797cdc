"""A biased gyro behind what became of a flight."""

import pytest

from perchhw.diagnosis.finding import Cause, Diagnosis
from perchhw.diagnosis.gyro import blame_gyro
from tests.diagnosis.conftest import Ended

TWO_LEGS = Diagnosis(Cause.TWO_LEGS, "it hangs on its fore legs only", "look at the pads", {"tau_s": 0.25})


def test_a_landing_that_went_wrong_with_a_biased_gyro_says_both(ended: Ended) -> None:
    found = blame_gyro(ended(None, bias=0.2), TWO_LEGS)
    assert found.cause is Cause.GYRO_BIASED
    assert found.sentence == f"the gyro read 0.20 rad/s while the drone stood still; {TWO_LEGS.sentence}"
    assert "reboot" in found.next
    assert found.values == {"tau_s": 0.25, "gyro_bias_rad_s": pytest.approx(0.2)}


def test_a_gyro_as_it_is_after_a_boot_is_not_blamed(ended: Ended) -> None:
    assert blame_gyro(ended(None, bias=0.008), TWO_LEGS) is TWO_LEGS
