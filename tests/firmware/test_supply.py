"""What either engine makes of samples that are no numbers, and of setpoints that come again."""

import math

import pytest

from onboard.firmware.library import CoreLibrary
from sim_backend.crazyflie.c_engine import CEngine
from sim_backend.crazyflie.reference_engine import ReferenceEngine
from sim_backend.crazyflie.setpoint import Setpoint
from tests.firmware.histories import VEHICLE, Stretch, samples


@pytest.mark.parametrize("kind", [ReferenceEngine, CEngine])
@pytest.mark.parametrize("voltage", [math.nan, math.inf])
def test_a_supply_that_was_not_measured_once_stops_no_motor(
    core: CoreLibrary, kind: type[CEngine] | type[ReferenceEngine], voltage: float
) -> None:
    engine, undisturbed = kind(VEHICLE), kind(VEHICLE)
    for ms, (_, sample) in enumerate(samples([Stretch(40)], seed=1)):
        engine.step(sample._replace(voltage=voltage) if ms == 20 else sample)
        undisturbed.step(sample)
        assert engine.ratios == pytest.approx(undisturbed.ratios, abs=200)


@pytest.mark.parametrize("kind", [ReferenceEngine, CEngine])
def test_an_engine_that_knows_a_setpoint_again_sees_how_old_it_is(
    core: CoreLibrary, kind: type[CEngine] | type[ReferenceEngine]
) -> None:
    """Its age stands beside it, and moves the place that a velocity leads to."""
    asked = [sample for _, sample in samples([Stretch(60, setpoint="velocity")], seed=1)]
    same, copied = kind(VEHICLE), kind(VEHICLE)
    for sample in asked:
        same.step(sample)
        copied.step(sample._replace(setpoint=Setpoint(*sample.setpoint)))
        assert same.ratios == pytest.approx(copied.ratios, abs=0)
