"""From one run's record to one finding: what happened, why, and what to do next."""

from pathlib import Path

from calibration.flights import UnusableFlightError
from calibration.flights.perchhw_run import flight_from_run
from onboard.json_file import write_json_atomically
from onboard.policy.bundle import policy_crc32
from onboard.policy.files import Policy, load_policy, shipped_policies, shipped_policy_path
from onboard.record.checksum import with_checksum
from onboard.record.folder import OutputFolderError
from onboard.record.run_record import RUN_FILE, RunRecord
from onboard.vehicle import Vehicle
from perchhw.attempt import DEFAULT_POLICY, Outcome
from perchhw.diagnosis.ended_early import diagnose_ended, where_it_ended
from perchhw.diagnosis.finding import Cause, Diagnosis
from perchhw.diagnosis.flown_course import diagnose_test_flight
from perchhw.diagnosis.gyro import blame_gyro
from perchhw.diagnosis.landing import Judge, diagnose_landing
from perchhw.diagnosis.no_trigger import diagnose_no_trigger
from perchhw.label import LabelError
from perchhw.label.landing_label import MISSED_TRIGGER_RULES
from perchhw.record.flown import known_vehicle_of, policy_of
from perchhw.record.run import read_run

_AGAIN = "fly it again"
_UNTOLD = "the record does not tell why"


def diagnose_run(run: RunRecord) -> Diagnosis:
    """The finding of a run, with vehicle and policy as its record names them."""
    return diagnose(run, known_vehicle_of(run), judge_of(run))


def keep_diagnosis(folder: Path) -> Diagnosis:
    """The finding of the run `folder`, put into its ``run.json`` too.

    Raises:
        RunFolderError: the record cannot be read.
        OutputFolderError: it cannot be written.
    """
    run = read_run(folder)
    found = diagnose_run(run)
    try:
        told = with_checksum({**run.info, "diagnosis": found})
        write_json_atomically(folder / RUN_FILE, told)
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error
    return found


def diagnose(run: RunRecord, vehicle: Vehicle | None, judge: Judge) -> Diagnosis:
    """The finding of a run.

    Args:
        run: its record.
        vehicle: what flew; None: unknown, then a landing is told without its flip.
        judge: policies to hold the flip against.
    """
    info = run.info
    if info.get("error"):
        return Diagnosis(
            Cause.INTERNAL_ERROR,
            f"the flight program failed: {info['error']}",
            "keep the record and report it",
        )
    if not run.closed and not any(e.get("phase") == "done" for e in run.events):
        return _killed(run)
    if info.get("record_lost"):
        return Diagnosis(
            Cause.RECORD_LOST,
            f"the record was lost: {info['record_lost']}",
            "make room on the disk, fly again",
        )
    aborted_by = info.get("aborted_by")
    if aborted_by is not None and aborted_by not in MISSED_TRIGGER_RULES:
        return diagnose_ended(run, str(aborted_by))
    if run.config.get("dry_run"):
        return Diagnosis(
            Cause.DRY_RUN, "the dry run passed: checks, upload and read-back", "fly it without --dry-run"
        )
    return _flown(run, vehicle, judge)


def _killed(run: RunRecord) -> Diagnosis:
    phase, _ = where_it_ended(run)
    where = "before its first phase" if phase is None else f"while {phase}"
    sentence = f"the flight program was killed {where}: the record ends there"
    remedy = "see that the drone is at rest and reboot it, then fly again (a campaign: --resume)"
    return Diagnosis(Cause.PROCESS_KILLED, sentence, remedy, {"phase": phase})


def _flown(run: RunRecord, vehicle: Vehicle | None, judge: Judge) -> Diagnosis:
    """What no rule ended: a landing, a trigger that never came, or a flight without a policy."""
    if run.config.get("flight"):
        return diagnose_test_flight(run)
    outcome = Outcome(run.info["outcome"]) if run.info.get("outcome") in tuple(Outcome) else None
    if outcome is None or outcome is Outcome.ABORTED:
        return Diagnosis(Cause.FLOWN, "flown to its end", "perchhw log label RUN says how it ended")
    try:
        flight = flight_from_run(run)
        if flight.trigger is None:
            return blame_gyro(run, diagnose_no_trigger(flight, judge))
        if vehicle is not None:
            found = diagnose_landing(flight, flight.trigger, outcome, vehicle, judge)
            return found if outcome is Outcome.FOUR_LEG else blame_gyro(run, found)
    except (UnusableFlightError, LabelError) as error:
        return Diagnosis(Cause.FLOWN, f"{outcome.value}; {_UNTOLD} ({error})", _AGAIN)
    return Diagnosis(Cause.FLOWN, f"{outcome.value}; its vehicle file is not at hand", _AGAIN)


def judge_of(run: RunRecord) -> Judge:
    """The policy that flew, and the one whose region counts: itself where it ships for this vehicle, else the
    default one where that is for it."""
    flown = policy_of(run)
    shipped = {name: load_policy(shipped_policy_path(name)) for name in shipped_policies()}
    fitting = {name: policy for name, policy in shipped.items() if _is_for(policy, run)}
    if flown is not None and policy_crc32(flown) in map(policy_crc32, fitting.values()):
        return Judge(flown, flown)
    return Judge(flown, fitting.get(DEFAULT_POLICY, flown))


def _is_for(policy: Policy, run: RunRecord) -> bool:
    learned = policy.provenance.get("sweep", {}).get("settings", {})
    return all(run.config.get(name) == learned.get(name) for name in ("vehicle", "legs"))
