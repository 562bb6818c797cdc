"""Records to explain: simulated landings, and attempts that ended for a given reason."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from onboard.record.recorder import Scalar
from onboard.record.run_record import RunRecord
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.record import RunRecorder
from perchhw.record.run import read_run

Ended = Callable[..., RunRecord]


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle("crazyflie21-upgraded")


@pytest.fixture
def ended(tmp_path: Path) -> Ended:
    """Write the record of an attempt that ended while approaching; its last poses are as `verdicts` says, and
    of those on the ground the first ``jumped`` were refused."""

    def write(aborted_by: str | None, verdicts: str = "OK", age: float = 0.009, **info: Any) -> RunRecord:
        folder = tmp_path / "run"
        config = {"vehicle": "crazyflie21-upgraded", "legs": "semi-narrow-long", "ceiling_z": 2.1}
        with RunRecorder(folder, config, clock=lambda: 0.0) as recorder:
            recorder.event("phase", 0.0, phase="checking", aborted_by=None)
            for k in range(100):
                t = 0.01 * k
                on_the_ground = "FLIPPED" if k < info.get("jumped", 0) else "OK"
                verdict = on_the_ground if t < 0.7 else verdicts
                pose: dict[str, Scalar] = {"x": 0.0, "frame": k, "verdict": verdict, "capture_time": t - age}
                recorder.write("pose", t, pose)
                recorder.write("rates", t, {"gx": info.get("bias", 0.0), "gy": 0.0, "gz": 0.0})
            recorder.event("phase", 0.5, phase="arming", aborted_by=None)
            recorder.event("phase", 0.55, phase="taking off", aborted_by=None)
            recorder.event("phase", 0.6, phase="approaching", aborted_by=None)
            recorder.event("phase", 1.0, phase=info.get("way_out", "braking"), aborted_by=aborted_by)
            recorder.event("phase", 2.0, phase="done", aborted_by=aborted_by)
            recorder.close(outcome="aborted", aborted_by=aborted_by, record_lost=info.get("record_lost"))
        return read_run(folder)

    return write
