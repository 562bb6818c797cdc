"""A hover before the first attempt of a drone: motors and pack are then as warm as in all that follow."""

from onboard.manoeuvres import HOVER
from onboard.record.folder import new_run_folder
from perchhw.attempt import AttemptRequest, WarmUpAborted
from perchhw.flight.course import CourseRequest, fly_uninterrupted
from perchhw.flight.loop import OnPhase
from perchhw.flight.recording import RecordListener

FOLDER = "warm-ups"
"""Beside the folder of the attempts."""


def warm_up(request: AttemptRequest, on_phase: OnPhase | None, listener: RecordListener | None) -> None:
    """Hover for ``request.warm_up_s`` before the attempt of `request`; recorded as a test flight.

    Raises:
        WarmUpAborted: a safety rule ended it.
        PerchhwError, KeyboardInterrupt: as :func:`perchhw.flight.course.fly_uninterrupted`.
    """
    hover = CourseRequest(
        kind=HOVER,
        parameters={"seconds": request.warm_up_s},
        folder=new_run_folder(request.folder.parent.parent / FOLDER, f"{request.index:03d}-hover"),
        drone=request.drone,
        mocap=request.mocap,
        vehicle=request.vehicle,
        legs=request.legs,
        room=request.room,
        lab=request.lab,
        operator=request.operator,
        note=request.note,
    )
    flown = fly_uninterrupted(hover, on_phase=on_phase, listener=listener)
    if flown.aborted_by is not None:
        raise WarmUpAborted(f"the warm-up hover was aborted by {flown.aborted_by} ({flown.record})")
