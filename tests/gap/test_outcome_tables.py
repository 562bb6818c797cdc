"""The table of what vehicles predict: nothing is simulated twice, and nothing comes out otherwise for it."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.flights import flight_files, open_flights
from calibration.gap.landings.outcomes import PreparedLandings, prepare, tables
from calibration.gap.landings.outcomes.pad_laws import PadLaw, pad_laws
from calibration.gap.landings.outcomes.predict import forecast
from calibration.gap.landings.outcomes.tables import tabulate
from calibration.gap.landings.outcomes.vehicles import WITHOUT, Point, bare_parameters, shapes, with_point
from onboard.vehicle import load_vehicle
from tests.truth.landings.drone import Drone
from tests.truth.landings.judge import VEHICLE
from tests.truth.landings.outcomes import write_outcomes

BARE = bare_parameters(load_vehicle(VEHICLE))
SOFT = Point(stiffness=1.6, damping=8.0)


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedLandings:
    """Four flights, of which one never gets to the ceiling."""
    folder: Path = tmp_path_factory.mktemp("flights")
    write_outcomes(Drone(), 4, 5, folder / "f", folder / "answer.json")
    flights, _ = open_flights(flight_files([folder / "f"]))
    ready = prepare(flights, load_vehicle(VEHICLE), np.random.default_rng(1), 20)
    ceilings = ready.ceilings.copy()
    ceilings[3] += 2.0
    return dataclasses.replace(ready, ceilings=ceilings)


def rungs() -> list[Point]:
    """Vehicles of one limit by every law, on several bodies, in no order."""
    laws = pad_laws(BARE)
    ruled = [SOFT._replace(**{law.limit: limit}) for law in laws.values() for limit in law.limits]
    shaped = [SOFT._replace(speed=0.6, **shape) for shape in shapes(BARE)]
    reaches = [WITHOUT._replace(reach=reach, speed=speed) for reach in (0.3, 1.0) for speed in (1.2, 0.45)]
    both = SOFT._replace(speed=0.6, preload=0.5, preload_spread=0.2)
    return [*ruled[::-1], *shaped, *reaches, both, WITHOUT]


@pytest.mark.further
def test_vehicles_share_approaches_and_landings_without_any_coming_out_otherwise(
    prepared: PreparedLandings,
) -> None:
    """Each vehicle by itself, from the trigger to rest, says the same: but for what a compiler may round."""
    points = rungs()
    table = tabulate(prepared, BARE, points)
    alone = np.array([forecast(prepared, with_point(BARE, one)).probability for one in points])
    np.testing.assert_allclose(table, alone, atol=1.0 / 20 + 1e-9)  # one landing of 20 at most
    assert np.mean(table != alone) < 0.01
    assert np.ptp(table[:, :3, 0], axis=0).min() > 0.4  # and they do differ
    np.testing.assert_array_equal(table[:, 3], np.tile([0.0, 0.0, 1.0], (len(points), 1)))


@pytest.mark.further
def test_limits_that_change_nothing_are_not_flown_again(
    prepared: PreparedLandings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hardly a foot comes as slowly as a millimetre a second: of such limits one is flown for all."""
    flown: list[int] = []
    land = tables.land

    def counted(*given: Any) -> int:
        flown.append(land(*given))
        return flown[-1]

    def landings_a_draw(limits: tuple[float, ...]) -> float:
        flown.clear()
        one = PadLaw("speed", "spread", limits, limits, (0.1,))
        monkeypatch.setattr(tables, "pad_laws", lambda parameters: {"pads": one})
        tabulate(prepared, BARE, [SOFT._replace(speed=limit) for limit in limits])
        return sum(flown) / prepared.draws[..., 0].size

    monkeypatch.setattr(tables, "land", counted)
    assert landings_a_draw(tuple(np.linspace(0.0, 1e-3, 21).tolist())) < 1.1
    assert 1.5 < landings_a_draw(tuple(np.linspace(0.0, 2.0, 21).tolist())) < 14.0
