"""How near flights of the simulated lab come to the corridor of the approach and to the speed between hovers.

    python benchmarks/supervised_margins.py [--seed 1]

Flies eight attempts in lock step, from slow to fast and from flat to steep, and prints one JSON document with
the largest of each and of all: deviation from the planned approach before the trigger, as the corridor judges
it (m, m/s, deg); speed of the estimate on the way from take-off to the start of the approach (m/s); and time
from the cut until motion capture sees a body that hangs on four feet, as the supervisor judges it (s).
"""

import argparse
import json
import sys
import tempfile
from math import hypot
from pathlib import Path

import numpy as np

from onboard.app_interface import LandingState
from onboard.jit import interpreted
from onboard.outcome import Outcome
from onboard.record.run_record import RunRecord
from onboard.rotation import body_z, to_matrices
from onboard.trajectory import ApproachPlan, fit_approach
from perchhw.attempt import DEFAULT_POLICY, AttemptRequest
from perchhw.flight.turnaround import attempt_after_attempt
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run
from perchhw.supervisor import Phase, SafetyLimits
from perchhw.supervisor.corridor import deviation

VEHICLE = "crazyflie21-upgraded-stored"
"""Its feet always hold, so that most landings hang on four of them."""
CONDITIONS = (
    (1.5, 60.0),
    (1.75, 88.0),
    (2.0, 70.0),
    (2.25, 55.0),
    (2.5, 50.0),
    (2.75, 52.5),
    (3.0, 30.0),
    (3.0, 45.0),
)
"""Speed (m/s) and angle (deg) of the approaches."""
_axis = interpreted(body_z)


def entered(run: RunRecord, phase: Phase) -> float:
    """When the flight came into `phase`, s; infinite when it never did."""
    return next((float(event["t"]) for event in run.events if event.get("phase") == phase), float("inf"))


def of_flight(run: RunRecord, plan: ApproachPlan) -> dict[str, float]:
    """The largest deviations of one flight and its largest speed before."""
    estimate, cues = run.series["estimate"], run.series["cues"]
    states = cues.numbers("state")
    began = float(cues.t[states == LandingState.APPROACH][0])
    ended = float(cues.t[(states > LandingState.APPROACH) & (cues.t > began)][0])
    window = SafetyLimits().corridor_time
    found: list[tuple[float, float, float]] = []
    moving = 0.0
    names = ("x", "y", "z", "vx", "vy", "vz", "qx", "qy", "qz", "qw")
    rows = np.stack([estimate.numbers(name) for name in names], axis=1)
    for t, row in zip(estimate.t, rows.tolist(), strict=True):
        if entered(run, Phase.TAKING_OFF) < t < entered(run, Phase.ARMING_APPROACH):
            moving = max(moving, hypot(*row[3:6]))
        if began <= t < ended:
            axis = _axis(tuple(row[6:]))
            found.append(deviation(plan, t - began, window, tuple(row[:3]), tuple(row[3:6]), axis))
    distance, speed, tilt = (max(values) for values in zip(*found, strict=True))
    return {"distance_m": distance, "speed_m_s": speed, "tilt_deg": tilt, "speed_before_m_s": moving}


def hangs_after(run: RunRecord, limits: SafetyLimits) -> float:
    """Time from the cut until the body hangs for good, s."""
    poses, cut = run.series["pose"], entered(run, Phase.SETTLING)
    after = poses.t > cut
    place = np.stack([poses.numbers(name)[after] for name in ("x", "y", "z")], axis=1)
    attitude = np.stack([poses.numbers(name)[after] for name in ("qx", "qy", "qz", "qw")], axis=1)
    ceiling = np.array([limits.room.ceiling_at(x, y) for x, y, _ in place.tolist()])
    tilt = np.arccos(np.clip(-to_matrices(attitude)[:, 2, 2], -1.0, 1.0))
    hangs = (ceiling - place[:, 2] <= limits.hang_distance) & (tilt <= limits.hang_tilt)
    times = poses.t[after][~hangs]
    return float(times[-1] - cut) if len(times) else 0.0


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the lab's noise")
    arguments = parser.parse_args()
    run = attempt_after_attempt(lambda _what: None)
    rows = []
    with (
        tempfile.TemporaryDirectory() as folder,
        SimulatedLab(
            "lab", (*FREE_PORTS, *LOCKSTEP, "--vehicle", VEHICLE, "--seed", str(arguments.seed))
        ) as lab,
    ):
        for index, (speed, angle) in enumerate(CONDITIONS):
            request = AttemptRequest(
                speed=speed,
                angle_deg=angle,
                index=index,
                folder=Path(folder) / str(index),
                drone=lab.drones[0],
                mocap=lab.mocap[0],
                policy=DEFAULT_POLICY,
                vehicle=VEHICLE,
            )
            result = run(request)
            figures = of_flight(read_run(result.record), fit_approach(speed, angle, request.room))
            if result.outcome is Outcome.FOUR_LEG:
                figures["hangs_after_s"] = hangs_after(read_run(result.record), SafetyLimits())
            rows.append({"speed": speed, "angle_deg": angle, "outcome": result.outcome.value, **figures})
    names = ("distance_m", "speed_m_s", "tilt_deg", "speed_before_m_s", "hangs_after_s")
    largest = {name: max((float(row[name]) for row in rows if name in row), default=None) for name in names}
    document = {
        "benchmark": "supervised_margins",
        "seed": arguments.seed,
        "largest": largest,
        "flights": rows,
    }
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
