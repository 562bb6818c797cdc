"""Fly in the simulated lab, over the real protocols: landings with a policy, and test flights."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.room import RoomGeometry
from perchhw.campaign import CampaignPlan, run_campaign
from perchhw.campaign.courses import FlightPlan, PlannedFlight, fly_plan
from perchhw.errors import FlightStackError
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab import flight_setup
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab

_ABORTED_IN_A_ROW = 3


@dataclass(frozen=True)
class WalkthroughDrone:
    """A simulated drone that may differ from what others believe of it.

    Attributes:
        vehicle: file of what it is.
        believed: name or file of what the host believes.
        seed: of the lab's noise.
        flashed: file that its firmware was built with; None: what it is.
    """

    vehicle: Path
    believed: str
    seed: int
    flashed: str | None = None

    def lab(self) -> SimulatedLab:
        """A lab with this drone, on free ports."""
        firmware = [] if self.flashed is None else ["--flashed", self.flashed]
        drone = ("--vehicle", str(self.vehicle), *firmware, "--seed", str(self.seed))
        return SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, *drone))


def _nobody(_request: str) -> None:
    """The simulated operator puts the drone back when it is rebooted."""


def fly_landings(
    folder: Path,
    drone: WalkthroughDrone,
    policy: str,
    speeds: Sequence[float],
    angles_deg: Sequence[float],
    repeats: int = 1,
) -> dict[str, Any]:
    """A campaign of landing attempts; goes on where an earlier one stopped.

    Returns:
        ``outcomes`` by name, ``attempts``, ``clean`` (on four legs, nothing else touched), and ``records``.
    """
    with drone.lab() as lab:
        plan = CampaignPlan(
            name=folder.name,
            drone=lab.drones[0],
            mocap=lab.mocap[0],
            policy=policy,
            vehicle=drone.believed,
            legs=None,
            seed=drone.seed,
            order="grid",
            speeds=tuple(speeds),
            angles_deg=tuple(angles_deg),
            repeats=repeats,
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


def fly_tests(folder: Path, drone: WalkthroughDrone, kinds: Sequence[str]) -> dict[str, Any]:
    """Test flights; goes on where an earlier campaign stopped.

    Raises:
        FlightStackError: a safety rule ended one of them.
    """
    with drone.lab() as lab:
        setup = flight_setup(None, drone=lab.drones[0], mocap=lab.mocap[0], vehicle=drone.believed)
        plan = FlightPlan(folder.name, setup, tuple(PlannedFlight(kind, {}) for kind in kinds))
        rows = fly_plan(plan, folder, _nobody, resume=True)
    stopped = next((row for row in rows if not row.done), None)
    if stopped is not None:
        raise FlightStackError(
            f"test flight {stopped.kind} was ended by {stopped.aborted_by}; the same command flies it again"
        )
    return {"flights": [row.kind for row in rows], "records": str(folder / "attempts")}
