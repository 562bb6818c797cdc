"""Samples that are no numbers: what either engine makes of them."""

import math

import pytest

from onboard.firmware.library import CoreLibrary
from sim_backend.crazyflie.c_engine import CEngine
from sim_backend.crazyflie.reference_engine import ReferenceEngine
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
