"""Adaptive campaigns: what they choose, also after a stop, when they end, and what they save."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perchhw.attempt import AttemptRequest, AttemptResult, Outcome
from perchhw.campaign import CampaignFileError, CampaignPlan, CampaignStore, load_plan, run_campaign
from perchhw.campaign.adaptive import choose, flown_map
from perchhw.campaign.rate_map import RateSurrogate
from tests.campaign.stand_in import fly
from tests.truth.landing_rate_maps import DrawnMap

CONDITIONS = [(float(speed), float(angle)) for speed in np.linspace(2, 3, 5) for angle in range(30, 61, 6)]
FILE = """schema = "perchhw.campaign/1"
drone = "udp://127.0.0.1:19850"
mocap = "vicon://127.0.0.1:18801?subject=cf1"
seed = 3
order = "adaptive"

[grid]
speeds = [2.0, 2.25, 2.5]
angles_deg = "40:60:5"
repeats = 2

[stop]
attempts = 12
"""


@pytest.fixture
def plan(tmp_path: Path) -> CampaignPlan:
    file = tmp_path / "adaptive.toml"
    file.write_text(FILE)
    return load_plan(file)


def steep_lands(request: AttemptRequest) -> AttemptResult:
    """Four legs from 50 deg on, and never below; the fourth attempt is aborted."""
    result = fly(request)
    outcome = Outcome.FOUR_LEG if request.angle_deg >= 50.0 else Outcome.FAILURE
    return replace(result, outcome=Outcome.ABORTED if request.index == 3 else outcome)


def test_it_chooses_the_same_again_after_a_stop(plan: CampaignPlan, tmp_path: Path) -> None:
    whole = run_campaign(plan, tmp_path / "whole", steep_lands)
    assert [row.slot for row in whole] == list(range(12))

    def stopped(request: AttemptRequest) -> AttemptResult:
        if request.index == 5 and request.try_number == 1:
            (request.folder / "run.json").write_text("{")
            raise KeyboardInterrupt
        return steep_lands(request)

    folder = tmp_path / "stopped"
    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, folder, stopped)
    rows = [row for row in run_campaign(plan, folder, stopped, resume=True) if row.state == "done"]
    assert [row.place for row in rows] == [row.place for row in whole]
    assert [row.try_number for row in rows if row.slot == 5] == [2]
    with closing(CampaignStore.open(folder)) as store:
        assert (store.planned, len(store.conditions)) == (12, 15)
    others = run_campaign(replace(plan, seed=4), tmp_path / "other", steep_lands)
    assert [row.place for row in others] != [row.place for row in whole]


def test_attempts_go_to_the_edge_and_the_map_is_found(plan: CampaignPlan, tmp_path: Path) -> None:
    plan = replace(plan, attempts=24)
    rows = run_campaign(plan, tmp_path / "c", steep_lands)
    found = flown_map(rows, plan.conditions())
    assert sum(found.flown) == 23  # the aborted one tells nothing
    rates = dict(zip(found.conditions, found.known.rate, strict=True))
    assert all(rate > 0.7 for (_, angle), rate in rates.items() if angle >= 55.0)
    assert all(rate < 0.3 for (_, angle), rate in rates.items() if angle <= 40.0)
    beside = sum(row.angle_deg in (45.0, 50.0) for row in rows)
    assert beside / len(rows) > 0.4  # they are two of five angles


def test_it_ends_when_the_map_is_known_well_enough(plan: CampaignPlan, tmp_path: Path) -> None:
    plan = replace(plan, attempts=None, map_error=0.25)
    rows = run_campaign(plan, tmp_path / "c", steep_lands)
    assert 5 < len(rows) < 25
    assert flown_map(rows, plan.conditions()).known.error <= 0.25
    assert flown_map(rows[:-1], plan.conditions()).known.error > 0.25


def test_only_an_adaptive_campaign_ends_by_its_map(tmp_path: Path) -> None:
    file = tmp_path / "grid.toml"
    file.write_text(FILE.replace("adaptive", "grid").replace("attempts = 12", "map_error = 0.1"))
    with pytest.raises(
        CampaignFileError, match=r"key stop.map_error: only a campaign with order = \"adaptive\""
    ):
        load_plan(file)


def test_what_is_known_of_a_rate_follows_the_counts() -> None:
    surrogate = RateSurrogate([(2.0, 40.0), (3.0, 40.0)])
    nothing = surrogate.fit(np.zeros(2), np.zeros(2))
    assert nothing.rate == pytest.approx([0.5, 0.5], abs=1e-9)
    flown = surrogate.fit(np.array([27.0, 0.0]), np.array([30.0, 0.0]))
    assert flown.rate[0] == pytest.approx(0.9, abs=0.03)
    assert flown.deviation[0] == pytest.approx(np.sqrt(0.9 * 0.1 / 30.0), rel=0.2)
    assert flown.deviation[1] > 2.0 * flown.deviation[0]
    assert flown.gain[1] > flown.gain[0]


def test_where_it_flies_next_an_attempt_brings_about_as_much_as_anywhere() -> None:
    """Held against the map made anew after either outcome, weighed by how likely each is."""
    surrogate, rng = RateSurrogate(CONDITIONS), np.random.default_rng(1)
    n = len(CONDITIONS)
    truth = 1.0 / (1.0 + np.exp(-6.0 * (np.array(CONDITIONS)[:, 0] - 2.5)))
    for attempts in (6, 20):
        flown = np.bincount(rng.integers(0, n, attempts), minlength=n).astype(float)
        landed = rng.binomial(flown.astype(int), truth).astype(float)
        known = surrogate.fit(landed, flown)
        brought = []
        for place, rate in zip(np.eye(n), known.rate, strict=True):
            after = [surrogate.fit(landed + lands * place, flown + place).error ** 2 for lands in (0, 1)]
            brought.append(known.error**2 - (1.0 - rate) * after[0] - rate * after[1])
        assert brought[choose(known, rng)] > 0.9 * max(brought) > 0.0


@pytest.mark.parametrize("shape", ["cliff", "band"])
def test_with_sixty_percent_of_the_attempts_the_map_is_better_than_the_grids(shape: str) -> None:
    truth = DrawnMap(shape, CONDITIONS, seed=11, most=90)
    every = truth.grid(3)
    chosen = truth.chosen(54)[-1]
    assert truth.error(truth.known(chosen).rate) < truth.error(truth.landed(every) / every)
