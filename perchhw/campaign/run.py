"""Run a campaign: one attempt after another through a runner, until all are done or a rule stops it."""

import fcntl
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from onboard.errors import InputError, PerchhwError, SafetyStop
from onboard.link.errors import DroneStopped
from onboard.lock_note import holder, write_note
from onboard.record.folder import make_folder, new_run_folder
from onboard.record.recorder import DiskNearlyFull
from perchhw.attempt import AttemptRequest, AttemptResult, AttemptRunner, Outcome, WarmUpAborted
from perchhw.campaign.aborts import AbortCount
from perchhw.campaign.adaptive import AdaptiveOrder
from perchhw.campaign.database import CampaignError, kept_in
from perchhw.campaign.plan import ADAPTIVE, CampaignPlan, Slot
from perchhw.campaign.store import AttemptRow, CampaignStore
from perchhw.campaign.turns import Turns
from perchhw.diagnosis.reasons import abort_kind
from perchhw.diagnosis.rules import AbortKind
from perchhw.errors import FlightStackError

LOCK_FILE = "campaign.lock"
ATTEMPTS = "attempts"
"""Folder of the records, in that of the campaign."""
RETRY = "(and --retry-aborted, to fly what was aborted again)"

OnChange = Callable[[list[AttemptRow]], None]


class CampaignStopped(FlightStackError, SafetyStop):
    """The drone must be looked at first, or too many attempts in a row were aborted."""


def run_campaign(
    plan: CampaignPlan,
    folder: Path,
    runner: AttemptRunner,
    *,
    resume: bool = False,
    retry_aborted: bool = False,
    on_change: OnChange | None = None,
) -> list[AttemptRow]:
    """Fly what `plan` has left in the campaign `folder`; gives all rows at the end.

    Args:
        plan: the campaign.
        folder: where its database and records live.
        runner: flies one attempt.
        resume: continue a campaign that is there already (one that is not is started).
        retry_aborted: when resuming, plan aborted attempts again.
        on_change: called with all rows after each change, for a display.

    An attempt that ends with an error of ours (no link, a check failed) counts as aborted, with the error as
    the reason. The streak of aborted attempts begins at zero in every run of this function.

    Raises:
        CampaignStopped: ``plan.aborted_in_a_row`` attempts in a row were aborted, or as many of a kind as
            ``plan.aborts`` says, or after one nobody may go on before a person has looked (it was stopped by
            others, or its stop was not confirmed); or the disk is nearly full.
        CampaignError: the folder cannot be used.
        OutputFolderError: the folder cannot be written.
        DroneStopped: somebody stopped the drone between two attempts; the next one is planned still.
        InputError: an attempt cannot be flown as configured.
        KeyboardInterrupt: interrupted; the running attempt is kept as interrupted and planned again.
    """
    make_folder(folder)
    with only_one(folder), closing(_store(plan, folder, resume, retry_aborted)) as store, kept_in(folder):
        return _fly_all(plan, store, runner, on_change or (lambda rows: None))


def _store(plan: CampaignPlan, folder: Path, resume: bool, retry_aborted: bool) -> CampaignStore:
    if resume and CampaignStore.exists(folder):
        return CampaignStore.resumed(folder, plan, retry_aborted)
    return CampaignStore.create(folder, plan)


def _fly_all(
    plan: CampaignPlan, store: CampaignStore, runner: AttemptRunner, on_change: OnChange
) -> list[AttemptRow]:
    aborts = AbortCount(plan.aborted_in_a_row, plan.aborts)
    turns = Turns(plan, [row.record for row in store.rows() if row.record is not None])
    on_change(store.rows())
    choice = AdaptiveOrder(plan) if plan.order == ADAPTIVE else None
    while (row := _next_row(store, choice)) is not None:
        result, kind = _fly_one(plan, store, row, runner, turns, on_change)
        on_change(store.rows())
        if result.halt is not None:
            again = f" {RETRY}" if kind is not None else ""
            raise CampaignStopped(f"stopped: {result.halt}, then continue with --resume{again}")
        reached = aborts.ended(kind)
        if reached is not None:
            raise CampaignStopped(
                f"stopped: {reached}, the last one by {result.aborted_by or 'an unnamed rule'}; put that "
                f"right and continue with --resume {RETRY}"
            )
    return store.rows()


def _next_row(store: CampaignStore, choice: AdaptiveOrder | None) -> AttemptRow | None:
    """What was planned already, in flying order; then what the campaign chooses to fly next."""
    row = store.next_planned()
    if row is not None or choice is None:
        return row
    slot = choice.next(store.rows())
    return None if slot is None else store.plan_next(slot)


def _fly_one(
    plan: CampaignPlan,
    store: CampaignStore,
    row: AttemptRow,
    runner: AttemptRunner,
    turns: Turns,
    on_change: OnChange,
) -> tuple[AttemptResult, AbortKind | None]:
    """Fly the attempt of `row`, with its state committed before and after; what came of it, and by what kind
    of thing it was aborted, if it was.
    """
    name = f"{row.slot:03d}-try{row.try_number}-{row.speed:g}ms-{row.angle_deg:g}deg"
    record = new_run_folder(store.folder / ATTEMPTS, name)
    with store.settled(record):
        store.start(row, record)
        on_change(store.rows())
        request = turns.prepared(request_of(plan, row.place, record, row.try_number), row.place)
        result, kind = _result(request, runner)
        turns.flown(request)
        store.finish(row, result.outcome, result.aborted_by, result.triggered, result.trigger)
    return result, kind


def _result(request: AttemptRequest, runner: AttemptRunner) -> tuple[AttemptResult, AbortKind | None]:
    try:
        result = runner(request)
    except (InputError, DroneStopped):
        raise
    except (WarmUpAborted, DiskNearlyFull) as error:
        raise CampaignStopped(f"stopped: {error}; put that right and continue with --resume") from error
    except PerchhwError as error:
        result = AttemptResult(
            Outcome.ABORTED, triggered=False, trigger=None, aborted_by=str(error), record=request.folder
        )
        return result, abort_kind(str(error), error)
    aborted = result.outcome is Outcome.ABORTED
    return result, abort_kind(result.aborted_by or "") if aborted else None


def request_of(plan: CampaignPlan, slot: Slot, record: Path, try_number: int) -> AttemptRequest:
    """What `plan` asks for in one try of `slot`."""
    return AttemptRequest(
        speed=slot.speed,
        angle_deg=slot.angle_deg,
        index=slot.number,
        folder=record,
        drone=plan.drone,
        mocap=plan.mocap,
        policy=plan.policy,
        vehicle=plan.vehicle,
        legs=plan.legs,
        room=plan.room,
        lab=plan.lab,
        seed=plan.attempt_seed(slot.number, try_number),
        try_number=try_number,
        approach=dict(plan.approach),
        operator=plan.operator,
        note=plan.note,
        accept_mismatch=plan.accept_mismatch,
    )


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Hold the campaign's lock; the system releases it when the process dies, however it dies."""
    with (folder / LOCK_FILE).open("a") as stream:  # whoever holds it has noted there who it is
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise _already_running(folder) from error
        write_note(stream.fileno(), "campaign")
        yield


def refuse_running(folder: Path) -> None:
    """Before anybody asks for its drones, which would be said to be in use.

    Raises:
        CampaignError: a process runs the campaign in `folder` now; the message says which.
    """
    if is_held(folder):
        raise _already_running(folder)


def _already_running(folder: Path) -> CampaignError:
    return CampaignError(
        f"{folder}: this campaign is already running, by {holder(folder / LOCK_FILE)}: wait for it or end it "
        f"there, or watch it with `perchhw view {folder}`"
    )


def is_held(folder: Path) -> bool:
    """Whether a process runs the campaign in `folder` now."""
    try:
        with (folder / LOCK_FILE).open() as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (FileNotFoundError, NotADirectoryError):  # nobody has run it yet, or can
        return False
    return False
