"""Fly in the simulated lab, over the real protocols: landings with a policy, and test flights."""

from collections import Counter
from pathlib import Path
from typing import Any

from onboard.room import RoomGeometry
from perchhw.campaign import CampaignPlan, run_campaign
from perchhw.campaign.courses import FlightPlan, PlannedFlight, fly_plan
from perchhw.errors import FlightStackError
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.gap_walkthrough.story import BELIEVED, LANDING_ANGLES, LANDING_SPEEDS, TEST_FLIGHTS
from perchhw.lab_process import SimulatedLab

_ABORTED_IN_A_ROW = 3
_TRIES = 6
"""Runs of the test flights: one that a busy machine ended is flown again."""


def _nobody(_request: str) -> None:
    """The simulated operator puts the drone back when it is rebooted."""


def _lab(vehicle: Path, seed: int) -> SimulatedLab:
    ports = ["--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0"]
    return SimulatedLab("lab", [*ports, "--vehicle", str(vehicle), "--seed", str(seed)])


def fly_landings(folder: Path, vehicle: Path, policy: str, seed: int) -> dict[str, Any]:
    """A campaign of landing attempts of the drone `vehicle`; goes on where an earlier one stopped.

    Returns:
        ``outcomes`` by name, ``attempts``, ``clean`` (on four legs, nothing else touched), and ``records``.
    """
    with _lab(vehicle, seed) as lab:
        plan = CampaignPlan(
            name=folder.name,
            drone=lab.drones[0],
            mocap=lab.mocap[0],
            policy=policy,
            vehicle=BELIEVED,
            legs=None,
            seed=seed,
            order="grid",
            speeds=LANDING_SPEEDS,
            angles_deg=LANDING_ANGLES,
            repeats=1,
            room=RoomGeometry(),
            approach={},
            aborted_in_a_row=_ABORTED_IN_A_ROW,
        )
        rows = run_campaign(plan, folder, attempt_after_attempt(_nobody), resume=True, retry_aborted=True)
    outcomes = Counter(str(row.outcome) for row in rows if row.state == "done")
    return {
        "attempts": sum(outcomes.values()),
        "clean": outcomes["four_leg"],
        "outcomes": dict(outcomes),
        "records": str(folder / "attempts"),
    }


def fly_tests(folder: Path, vehicle: Path, seed: int) -> dict[str, Any]:
    """The test flights of the drone `vehicle`; goes on where an earlier campaign stopped.

    Raises:
        FlightStackError: a safety rule ended one of them.
    """
    with _lab(vehicle, seed) as lab:
        plan = FlightPlan(
            name=folder.name,
            drone=lab.drones[0],
            mocap=lab.mocap[0],
            vehicle=BELIEVED,
            legs=None,
            room=RoomGeometry(),
            flights=tuple(PlannedFlight(kind, {}) for kind in TEST_FLIGHTS),
        )
        for _ in range(_TRIES):
            rows = fly_plan(plan, folder, _nobody, resume=True)
            if all(row.done for row in rows):
                return {"flights": [row.kind for row in rows], "records": str(folder / "attempts")}
    stopped = next(row for row in rows if not row.done)
    raise FlightStackError(
        f"test flight {stopped.kind} ended early {_TRIES} times, last by {stopped.aborted_by}; is the "
        "machine too busy for a lab in real time? The same command goes on"
    )
