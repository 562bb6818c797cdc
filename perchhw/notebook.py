"""The main steps of perchhw as plain functions, for notebooks and scripts (``import perchhw``)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from onboard.checked_arguments import ArgumentError, checked_count, checked_name, checked_numbers
from onboard.linear_algebra import on_one_thread
from onboard.policy.files import Policy, find_policy
from onboard.policy.files import load_policy as read_policy

if TYPE_CHECKING:
    from calibration.flights import Flight, UnusableFlight
    from calibration.gap.find import GapResult
    from onboard.lab_file import LabFile
    from onboard.vehicle import Vehicle
    from perchhw.attempt import AttemptResult
    from perchhw.campaign import AttemptRow
    from perchhw.lab_process import SimulatedLab
    from perchhw.label import LandingLabel
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep import SweepSummary

_OPENED_SO = ": flights, unusable = perchhw.open_flights(PATH) gives some, and what was left out"


def load_policy(name_or_path: str | Path = "default") -> Policy:
    """A policy: the name of a shipped one, or a ``*.policy.json``.

    Raises:
        PolicyError: there is none, or it cannot be used.
        ArgumentError: it is neither a name nor a file.

    >>> load_policy("default").name
    'default'
    """
    return read_policy(find_policy(name_or_path))


def simulate_approach(
    policy: Policy | str | Path,
    speed: float,
    angle_deg: float,
    *,
    setup: "LearningSetup | None" = None,
    seed: int | None = None,
) -> "Flight":
    """One approach of `policy` in the physics alone, sampled at 100 Hz until it has come to rest.

    Args:
        policy: two-stage policy, or as :func:`load_policy` finds it.
        speed: on the approach line, m/s.
        angle_deg: of that line above the horizon, deg.
        setup: vehicle, legs, randomisation, errors of the cues; default: those of the shipped policy.
        seed: of everything random; default: that of `setup`.

    Returns:
        The true motion (world; rates in the body frame), feet and cues; the trigger is what the policy saw.

    Raises:
        LearningInputError: no approach has such a speed or angle, or the setup cannot be used.
        PolicyError, VehicleFileError: nor can policy or vehicle.
        ArgumentError: speed, angle or seed is no number of its kind, or `setup` is none.

    >>> flight = simulate_approach(load_policy(), 2.5, 50.0)
    >>> bool(flight.data["z"][-1] > 2.0), int(flight.data["legs_attached"][-1])   # it hangs by all its legs
    (True, 4)
    """
    from perchhw.learning.examples import example_flight
    from perchhw.learning.grid import conditions
    from perchhw.learning.setup import LearningSetup

    policy = policy if isinstance(policy, Policy) else load_policy(policy)
    (condition,) = conditions((speed,), (angle_deg,))
    setup = _setup(setup, LearningSetup(legs="semi-narrow-long"))
    if seed is not None:
        setup = replace(setup, seed=seed)
    return example_flight(policy, setup, condition)


@on_one_thread()
def sweep(
    folder: str | Path,
    speeds: Iterable[float],
    angles_deg: Iterable[float],
    *,
    repeats: int = 1,
    setup: "LearningSetup | None" = None,
    resume: bool = False,
) -> "SweepSummary":
    """Learn a sensory-motor pair (EPHE) for every speed (m/s) and angle (deg), on all cores.

    Args:
        folder: where ``pairs.csv`` and ``sweep.json`` go.
        speeds, angles_deg, repeats: the grid, and how often each condition is learned.
        setup: what the rollouts run on; default: the shipped vehicle with the paper's reward.
        resume: go on with a sweep that was stopped.

    Raises:
        LearningInputError: the grid, the setup or the folder cannot be used.
        ArgumentError: speeds, angles or repeats are no numbers of their kind, or `setup` is none.

    >>> import tempfile
    >>> summary = sweep(tempfile.mkdtemp(), speeds=[3.0], angles_deg=[37.5])
    >>> summary.rows[0]["landing_rate"] > 0.5
    True
    """
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep import SweepGrid, run_sweep

    grid = SweepGrid(
        checked_numbers(speeds, "speeds"),
        checked_numbers(angles_deg, "angles_deg"),
        checked_count(repeats, "repeats", least=1),
    )
    return run_sweep(_setup(setup, LearningSetup()), grid, Path(folder), resume=resume)


@on_one_thread()
def train(
    folder: str | Path, *, name: str = "trained", landing_rate_min: float = 0.8, seed: int = 0
) -> Policy:
    """A two-stage policy from the pairs of a sweep's folder.

    Args:
        folder: of the sweep.
        name: of the policy.
        landing_rate_min: pairs below are left out, 0 to 1.
        seed: of everything random.

    Raises:
        TrainingError: the pairs are too few or do not vary.
        TrainingSetError: the folder holds no sweep that can be used, or the least landing rate is none.
        ArgumentError: the seed is none, or the rate no number.
    """
    from perchhw.learning.sweep_folder import PAIRS_FILE
    from perchhw.learning.train import train_policy
    from perchhw.learning.training_set import load_training_set

    seed = checked_count(seed, "seed")
    pairs = load_training_set(Path(folder) / PAIRS_FILE, landing_rate_min=landing_rate_min)
    return train_policy(pairs, name=name, seed=seed).policy


def fly(
    lab: "SimulatedLab | str | Path",
    speed: float,
    angle_deg: float,
    *,
    policy: str | Path = "default",
    out: str | Path = "runs",
    confirm: Callable[[str], object] | None = None,
) -> "AttemptResult":
    """One supervised attempt: check, upload, arm, fly, land, label, record; as ``perchhw fly``.

    Args:
        lab: a running simulated lab, or the lab file of the laboratory.
        speed: on the approach line, m/s.
        angle_deg: of that line above the horizon, deg.
        policy: name or file; one that was only trained is saved first (:func:`perchhw.save_policy`).
        out: folder for the record (a new folder inside it).
        confirm: asks somebody to put a drone that is locked, as after every flight and every stop, back on
            its start mark, and returns when that is done, as ``input`` does; then it is rebooted. In a
            simulated lab nobody has to. None: such a drone ends the attempt before take-off.

    Raises:
        PerchhwError: the attempt cannot begin; ArgumentError: `policy` is neither name nor file, or
            `lab` no lab.
        AttemptInterrupted: Ctrl-C; the drone was stopped and the record closed first.
    """
    from perchhw.flight import check_attempt, fly_attempt
    from perchhw.flight.turnaround import Turnaround
    from perchhw.lab import flight_setup
    from perchhw.record import discard_if_empty

    if isinstance(policy, Policy):
        raise ArgumentError("policy is a Policy: save it with perchhw.save_policy, and give its file")
    setup = flight_setup(_lab_file(lab), policy=checked_name(policy, "policy"))
    setup.check()
    request = setup.attempt(speed, angle_deg, Path(out))
    try:
        checked = check_attempt(request)  # before anybody is asked for the drone
        if confirm is not None:
            Turnaround(setup.drone, confirm).put_back_if_needed()
        return fly_attempt(request, checked=checked)
    finally:
        discard_if_empty(request.folder)


@on_one_thread()
def fly_campaign(
    lab: "SimulatedLab | str | Path",
    file: str | Path,
    folder: str | Path,
    *,
    confirm: Callable[[str], object],
    resume: bool = False,
) -> "list[AttemptRow]":
    """The attempts of a campaign file with a grid, and their report; as ``perchhw campaign run``, which flies
    test flights, too.

    Args:
        lab: a running simulated lab, or the lab file of the laboratory.
        file: campaign file (docs/campaigns.md).
        folder: where its database, records and report go.
        confirm: asks somebody to put the drone back on its start mark, and returns when that is done, as
            ``input`` does. In a simulated lab nobody has to.
        resume: go on with a campaign that was stopped.

    Raises:
        CampaignStopped: too many attempts in a row were aborted, or the drone must be looked at first.
        PerchhwError: lab, file, folder or drone cannot be used, or the file is one of test flights.
        KeyboardInterrupt: Ctrl-C; the drone was stopped and the attempt is planned again.
    """
    from perchhw.campaign import CampaignFileError, CampaignStopped, check_approaches, load_plan, run_campaign
    from perchhw.campaign.courses import has_flights
    from perchhw.campaign.run import refuse_running
    from perchhw.campaign.seats import drone_names, hold_all
    from perchhw.flight.turnaround import attempt_after_attempt
    from perchhw.report.campaign_report import write_campaign_report

    if has_flights(Path(file)):
        raise CampaignFileError(
            f"{file}: holds test flights, no grid of landings: `perchhw campaign run {file}` flies them"
        )
    plan = load_plan(Path(file), _lab_file(lab))
    check_approaches(plan)
    refuse_running(Path(folder))
    try:
        with hold_all(plan.drones):
            fly_one = attempt_after_attempt(confirm, names=drone_names(plan.drones))
            rows = run_campaign(plan, Path(folder), fly_one, resume=resume)
    except CampaignStopped:
        write_campaign_report(Path(folder), draw_all=False)
        raise
    write_campaign_report(Path(folder), draw_all=False)
    return rows


def _lab_file(lab: "SimulatedLab | str | Path") -> "LabFile | None":
    from perchhw.lab import find_lab
    from perchhw.lab_process import SimulatedLab

    if isinstance(lab, SimulatedLab):
        return find_lab(lab.lab_file)
    return find_lab(Path(checked_name(lab, "lab", "a running perchhw.SimulatedLab, or a lab file")))


def open_flights(*paths: str | Path, format: str = "auto") -> "tuple[list[Flight], list[UnusableFlight]]":
    """Flights of files and folders (records of perchhw, CSV, the authors' logs, public data sets).

    Returns:
        The usable ones, and the files that are broken or hold none, each with its reason.

    Raises:
        FlightFileError: a path does not exist, or a folder holds no flight.
    """
    from calibration import flights

    return flights.open_flights(flights.flight_files(paths), format)


def label_flight(
    flight: "Flight", vehicle: "Vehicle | str | Path", ceiling_z: float | None = None
) -> "LandingLabel":
    """The landing outcome of a flight, with the evidence for it; as ``perchhw log label``.

    Args:
        flight: see :func:`open_flights`.
        vehicle: with legs, or its name or file.
        ceiling_z: height of the ceiling, m; default: the flight's own.

    Raises:
        LabelError: the flight lacks what a label needs; the message says what.
        VehicleFileError: the vehicle cannot be used.
        CeilingError: there is no such ceiling.
        ArgumentError: `flight` or `vehicle` is something else.
    """
    from perchhw.label import label_flight

    (flight,) = _flights([flight])
    return label_flight(flight, _vehicle(vehicle), ceiling_z)


@on_one_thread()
def find_gap(
    flights: "Sequence[Flight]",
    vehicle: "Vehicle | str | Path",
    *,
    ceiling_z: float | None = None,
    seed: int = 0,
) -> "GapResult":
    """Where `vehicle` and measured `flights` disagree, which effects are missing, and the improved vehicle.

    Args:
        flights: see :func:`open_flights`.
        vehicle: the model, or its name or file.
        ceiling_z: height of the ceiling, m, if there is one.
        seed: of everything random.

    Raises:
        NothingToFindError: not one flight can be used.
        VehicleFileError: nor can the vehicle.
        CeilingError: there is no such ceiling, or a flight goes clearly above it.
        ArgumentError: `flights`, `vehicle` or `seed` is something else.
    """
    from calibration.gap import find

    asked = find.GapQuestion(vehicle=_vehicle(vehicle), seed=seed, ceiling_z=ceiling_z)
    return find.find_gap(_flights(flights), asked)


def _setup(given: "LearningSetup | None", default: "LearningSetup") -> "LearningSetup":
    from perchhw.learning.setup import LearningSetup

    if given is None:
        return default
    if not isinstance(given, LearningSetup):
        raise ArgumentError(f"setup is a {type(given).__name__}: give a perchhw.LearningSetup(...)")
    return given


def _vehicle(given: "Vehicle | str | Path") -> "Vehicle":
    from onboard.vehicle import Vehicle, load_vehicle

    return given if isinstance(given, Vehicle) else load_vehicle(checked_name(given, "vehicle"))


def _flights(given: "Sequence[Flight]") -> "list[Flight]":
    from calibration.flights import Flight

    if isinstance(given, str | Path) or not isinstance(given, Iterable):
        raise ArgumentError(f"flights is a {type(given).__name__}, no list of flights{_OPENED_SO}")
    flights = list(given)
    for one in flights:
        if not isinstance(one, Flight):
            raise ArgumentError(f"a {type(one).__name__} is no flight{_OPENED_SO}")
    return flights
