"""What the demo expects of its landings."""

from itertools import product
from pathlib import Path

import numpy as np

from onboard.room import RoomGeometry
from perchhw.attempt import AttemptRequest
from perchhw.cli.demo import ANGLES_DEG, SPEEDS, demo_plan, predicted_rates
from perchhw.flight.mission import plan_attempt

CONDITIONS = set(product(SPEEDS, ANGLES_DEG))


def test_the_demo_flies_where_the_policy_is_predicted_to_land_best() -> None:
    """Better than any of its neighbours a little slower, flatter or steeper, in the mean."""
    here = np.mean(list(predicted_rates(CONDITIONS, seed=0).values()))
    assert here > 0.75
    for slower, steeper in ((0.5, 0.0), (0.0, 10.0), (0.5, 10.0), (1.0, 0.0)):
        moved = {(round(speed - slower, 2), angle + steeper) for speed, angle in CONDITIONS}
        assert np.mean(list(predicted_rates(moved, seed=0).values())) < here


def test_predictions_are_those_of_the_seed() -> None:
    assert predicted_rates(CONDITIONS, seed=4) == predicted_rates(CONDITIONS, seed=4)


def test_every_condition_fits_the_room() -> None:
    plan = demo_plan("udp://127.0.0.1:1", "vicon://127.0.0.1:1?subject=cf1", 9, 1)
    for index, (speed, angle_deg) in enumerate(sorted(CONDITIONS)):
        request = AttemptRequest(
            speed=speed,
            angle_deg=angle_deg,
            index=index,
            folder=Path("never"),
            drone=plan.drone,
            mocap=plan.mocap,
            policy=plan.policy,
            vehicle=plan.vehicle,
            room=RoomGeometry(),
            seed=0,
        )
        plan_attempt(request, 0)
