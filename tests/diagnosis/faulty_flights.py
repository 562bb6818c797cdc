"""Flights with one known fault each: how often the diagnosis names it.

``python -m tests.diagnosis.faulty_flights --flights 200`` flies so many, each in a simulated lab of its own
in lock step, through all kinds of fault in turn. Expected is the injected fault; where a fault leaves the
landing alone, and where nothing was injected, what the world's own record shows. One JSON document at the
end; exit code 1 where so few would be right once in a hundred runs if 95 % were. With ``--table FILE`` each
flight is written there when it has been judged, and the next run with that file goes on with it.
"""

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from calibration.flights.table import load_table
from onboard.arrays import FloatArray
from onboard.policy.files import ActionLayer, find_policy, load_policy, save_policy
from onboard.policy.model import Policy
from onboard.record.checksum import with_checksum
from onboard.room import RoomGeometry
from onboard.rotation import to_matrices
from onboard.vehicle import load_vehicle
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE, AttemptInterrupted, AttemptRequest
from perchhw.diagnosis import Cause, diagnose_run
from perchhw.flight import fly_attempt
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.label import landing_geometry
from perchhw.record.run import read_run
from perchhw.supervisor import FlightState, Phase

CHANCE = 0.01
TARGET = 0.95
TOUCH_M = 0.003
"""Gap between feet and ceiling about which the world's record, at 100 Hz, does not decide."""


@dataclass(frozen=True)
class Fault:
    """One injected fault.

    Attributes:
        causes: any of which names it; empty: what the world's record shows.
        lab: faults of the simulated lab, ``NAME=VALUE``.
        policy: what flies instead of the shipped policy.
        ceiling_z: height that the flight believes in, m; the room has 2.1.
        speed: of the approach, m/s; None: drawn.
        interrupt: phase in which the operator presses Ctrl-C.
        killed: the flight program dies in its approach.
    """

    causes: tuple[Cause, ...] = ()
    lab: tuple[str, ...] = ()
    policy: Callable[[Policy], Policy] | None = None
    ceiling_z: float = 2.1
    speed: float | None = None
    interrupt: Phase | None = None
    killed: bool = False


def _shifted(seconds: float) -> Callable[[Policy], Policy]:
    """A policy whose region lies at larger times to contact: it fires earlier."""
    return lambda policy: replace(
        policy,
        scaler_mean=policy.scaler_mean + np.array([seconds, 0.0, 0.0], np.float32),
        tau_min=np.float32(policy.tau_min + seconds),
        tau_max=np.float32(policy.tau_max + seconds),
    )


def _scaled(factor: float) -> Callable[[Policy], Policy]:
    """A policy that asks for another moment, within its limits."""

    def scaled(policy: Policy) -> Policy:
        last = policy.layers[-1]
        layer = ActionLayer(last.weights * np.float32(factor), last.bias * np.float32(factor))
        return replace(policy, layers=(*policy.layers[:-1], layer))

    return scaled


_BEYOND = (Cause.CEILING_ELSEWHERE, Cause.CEILING_NOT_REACHED, Cause.REGION_MISSED)
"""A drone that does not even get to where it believes the ceiling cannot know that it is higher still."""


def faults(rng: np.random.Generator) -> dict[str, Fault]:
    """Every kind of fault, with its strength and time drawn from `rng`."""
    strikes = f"{rng.uniform(2.5, 7.6):.3f}"
    shift, bias = rng.uniform(0.03, 0.06), rng.uniform(0.15, 0.3)
    return {
        "none": Fault(),
        "fires early": Fault((Cause.FLIP_EARLY, Cause.REGION_ELSEWHERE), policy=_shifted(shift)),
        "fires late": Fault((Cause.FLIP_LATE, Cause.REGION_ELSEWHERE), policy=_shifted(-shift)),
        "turns weakly": Fault((Cause.FLIP_WEAK,), policy=_scaled(rng.uniform(0.4, 0.6))),
        "turns strongly": Fault((Cause.FLIP_STRONG,), policy=_scaled(rng.uniform(1.4, 1.6))),
        "ceiling higher": Fault(_BEYOND, ceiling_z=2.1 - rng.uniform(0.08, 0.15)),
        "ceiling lower": Fault((Cause.CEILING_ELSEWHERE,), ceiling_z=2.1 + rng.uniform(0.08, 0.15)),
        "other weight": Fault((Cause.OTHER_POLICY_COMPUTED,), ("policy_weight=0.5",)),
        "occluded": Fault((Cause.MOCAP_OCCLUDED,), (f"mocap_occlude_at={strikes}:2.0",)),
        "frozen": Fault((Cause.MOCAP_FROZEN,), (f"mocap_freeze_at={strikes}",)),
        "turned round": Fault((Cause.MOCAP_JUMPED,), (f"mocap_flip180_at={strikes}:2.0",)),
        "room dies": Fault((Cause.MOCAP_SILENT,), (f"mocap_dies_at={strikes}",)),
        "frames lost": Fault((Cause.MOCAP_SILENT,), (f"mocap_drop={rng.uniform(0.6, 0.7):.2f}",)),
        "poses late": Fault((Cause.MOCAP_LATE,), ("mocap_jitter_ms=60",)),
        "drone hangs": Fault((Cause.LINK_LOST,), (f"freeze_drone_at={strikes}",)),
        "drone dies": Fault((Cause.LINK_LOST,), (f"drone_dies_at={strikes}",)),
        "gyro biased": Fault((Cause.GYRO_BIASED,), (f"gyro_bias={bias:.3f},{-bias:.3f},0.0",)),
        "motors swapped": Fault((Cause.TUMBLED,), ("motors_swapped=1,2",)),
        "propeller reversed": Fault((Cause.TUMBLED,), ("propeller_reversed=2",)),
        "pack empty": Fault((Cause.BATTERY_LOW,), (f"battery_voltage={rng.uniform(3.5, 3.75):.2f}",)),
        "outside region": Fault((Cause.REGION_MISSED,), speed=float(rng.uniform(0.9, 1.1))),
        "operator": Fault(
            (Cause.OPERATOR,), interrupt=(Phase.TAKING_OFF, Phase.MOVING_TO_START)[int(rng.integers(2))]
        ),
        "killed": Fault((Cause.PROCESS_KILLED,), killed=True),
    }


@dataclass(frozen=True)
class Told:
    """One flight, and what its diagnosis made of it."""

    fault: str
    seed: int
    told: Cause
    expected: tuple[Cause, ...]
    sentence: str
    right: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "right", self.told in self.expected)


class Table:
    """Flights that were judged, one JSON line each; None: kept in memory alone."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._rows: dict[int, dict[str, Any]] = {}
        if path is not None and path.exists():
            text = path.read_text(encoding="utf-8")
            whole = text[: text.rfind("\n") + 1]  # the last line may have been cut off by a kill
            path.write_text(whole, encoding="utf-8")
            self._rows = {row["seed"]: row for row in map(json.loads, whole.splitlines())}

    def of(self, seed: int, fault: str) -> dict[str, Any] | None:
        """The flight `seed`, unless it was flown with another fault than `fault`."""
        row = self._rows.get(seed)
        return row if row is not None and row["fault"] == fault else None

    def keep(self, told: Told) -> dict[str, Any]:
        """Write one flight."""
        row = vars(told)
        self._rows[told.seed] = row
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(row) + "\n")
        return row


def fly(folder: Path, seed: int, name: str) -> Told:
    """Fly one attempt with the fault `name` in `folder`, and hold its diagnosis against the truth."""
    rng = np.random.default_rng((seed, 17))
    fault = faults(rng)[name]
    truth, run = folder / "truth.csv", folder / "run"
    shown = [part for one in fault.lab for part in ("--fault", one)]
    policy = DEFAULT_POLICY
    if fault.policy is not None:
        policy = str(folder / "other.policy.json")
        save_policy(fault.policy(load_policy(find_policy(DEFAULT_POLICY))), Path(policy))

    def on_phase(state: FlightState) -> None:
        if state.phase is fault.interrupt:
            os.kill(os.getpid(), signal.SIGINT)

    with SimulatedLab(
        "lab", (*FREE_PORTS, *LOCKSTEP, "--seed", str(seed), "--truth", str(truth), *shown)
    ) as lab:
        request = AttemptRequest(
            speed=fault.speed or float(rng.uniform(2.2, 2.8)),
            angle_deg=float(rng.uniform(50.0, 62.0)),
            index=0,
            folder=run,
            drone=lab.drones[0],
            mocap=lab.mocap[0],
            policy=policy,
            vehicle=DEFAULT_VEHICLE,
            room=RoomGeometry(ceiling_z=fault.ceiling_z),
            accept_mismatch=True,
        )
        with suppress(AttemptInterrupted):
            fly_attempt(request, on_phase=on_phase)
    if fault.killed:
        run = killed_in_its_approach(run, folder / "killed")
    found = diagnose_run(read_run(run))
    return Told(name, seed, found.cause, expected(fault, run, truth), found.sentence)


def killed_in_its_approach(run: Path, into: Path) -> Path:
    """What SIGKILL in the approach leaves of a record: files that end in the middle of a line."""
    shutil.copytree(run, into)
    info = json.loads((run / "run.json").read_text())
    left = {key: info[key] for key in ("schema", "config", "versions", "started_utc", "clock_at_start")}
    (into / "run.json").write_text(json.dumps(with_checksum({**left, "closed": False, "outcome": None})))
    events = (run / "events.jsonl").read_text()
    (into / "events.jsonl").write_text(events[: events.index('"approaching"') + 60])
    series = (run / "series.mcap").read_bytes()
    (into / "series.mcap").write_bytes(series[: len(series) // 2])
    return into


def expected(fault: Fault, run: Path, truth: Path) -> tuple[Cause, ...]:
    """The causes that are true: the fault, unless the landing went well in spite of it."""
    record = read_run(run)
    always = (Cause.OTHER_POLICY_COMPUTED, Cause.PROCESS_KILLED)
    if fault.causes and (record.info.get("aborted_by") or not record.info.get("triggered")):
        return fault.causes
    shown = what_the_world_saw(truth)
    if not fault.causes or (Cause.FOUR_LEGS in shown and not set(fault.causes) & set(always)):
        return shown
    return fault.causes


def what_the_world_saw(truth: Path) -> tuple[Cause, ...]:
    """How it ended, by the world's own record; two causes where 3 mm decide."""
    table = load_table(truth)
    _, z = table.series("z")
    near = z[:, 0] > 0.6 * z.max()
    _, touched = table.series("body_contact")
    _, legs = table.series("legs_attached")
    body = bool((touched[:, 0] * near > 0.0).any())
    feet = int(legs[-1, 0])
    if feet >= 3:
        return (Cause.FOUR_LEGS_BODY_CONTACT,) if body else (Cause.FOUR_LEGS,)
    if feet:
        return (Cause.TWO_LEGS,)
    _, pose = table.series("z", "qx", "qy", "qz", "qw")
    geometry = landing_geometry(load_vehicle(DEFAULT_VEHICLE))
    rotations = to_matrices(pose[:, 1:].copy())
    feet_gap: FloatArray = 2.1 - pose[:, 0] - geometry.feet_top(rotations)
    first_body = int(np.argmax((touched[:, 0] > 0.0) & near)) if body else len(pose)
    gap = float(feet_gap[: first_body + 1].min())
    if body and gap > TOUCH_M:
        return (Cause.BODY_FIRST,)
    if gap > TOUCH_M:
        return (Cause.CEILING_NOT_REACHED,)
    return (Cause.FEET_LET_GO,) if gap < -TOUCH_M else (Cause.FEET_LET_GO, Cause.CEILING_NOT_REACHED)


def judged(seed: int, name: str, keep: Path | None) -> Told:
    """Fly one, and keep in `keep` what was told wrongly."""
    with tempfile.TemporaryDirectory() as folder:
        told = fly(Path(folder), seed, name)
        if keep is not None and not told.right:
            shutil.copytree(folder, keep / str(seed))
    return told


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="Keep the records of wrong diagnoses here.")
    parser.add_argument("--table", type=Path, help="Write each flight here; those in it are not flown again.")
    arguments = parser.parse_args()
    names = sorted(faults(np.random.default_rng(0)))
    table, told = Table(arguments.table), []
    for index in range(arguments.flights):
        seed, name = arguments.seed + index, names[index % len(names)]
        row = table.of(seed, name) or table.keep(judged(seed, name, arguments.keep))
        told.append(row)
        sys.stderr.write(f"{index + 1} of {arguments.flights}: {row}\n")
    right = sum(row["right"] for row in told)
    document: dict[str, Any] = {
        "flights": len(told),
        "seed": arguments.seed,
        "right": right,
        "share": right / len(told),
        "wrong": [row for row in told if not row["right"]],
    }
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 0 if binom.cdf(right, len(told), TARGET) > CHANCE else 1


if __name__ == "__main__":
    sys.exit(main())
