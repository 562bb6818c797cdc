"""A short record with everything that a view shows, written by the recorder."""

import dataclasses
import math
from pathlib import Path

from onboard.app_interface import LandingState
from onboard.room import RoomGeometry
from onboard.supervisor_info import SupervisorBits
from onboard.trajectory import fit_approach
from perchhw.record import RunRecorder

BEGIN = 600.0
STEPS = 120
FLIP = 100
"""Step at which the drone flips."""
GONE = 40
"""Step at which the poses are occluded, and the link is silent."""


def record(folder: Path, *, close: bool = True) -> Path:
    """An approach of 1.2 s at 100 Hz; its first tau is 1.4e6 s."""
    room = RoomGeometry()
    config = {
        "speed_m_s": 2.5,
        "angle_deg": 50.0,
        "ceiling_z": room.ceiling_z,
        "vehicle": "crazyflie21-upgraded",
        "policy": "default",
        "room": dataclasses.asdict(room),
        "approach": dict(fit_approach(2.5, 50.0, room)._asdict()),
    }
    recorder = RunRecorder(folder, config, clock=lambda: BEGIN)
    recorder.event("phase", BEGIN, phase="checking", aborted_by=None)
    for step in range(STEPS):
        _step(recorder, step, BEGIN + 0.01 * step, room)
    order = "Order(number=7, command=GoTo(position=(-3.249128631103136, 0.0, 0.477)))"
    recorder.event("CommandFailed", BEGIN + 0.5, what=f"CommandFailed(order={order}, reason='no answer')")
    recorder.event("phase", BEGIN + 1.0, phase="flipping", aborted_by="pose_lost")
    if close:
        recorder.close(outcome="four_leg")
    return folder


def _step(recorder: RunRecorder, step: int, t: float, room: RoomGeometry) -> None:
    ms = {"drone_time_ms": 10.0 * step}
    gone = step == GONE
    place = {"x": None, "y": None, "z": None} if gone else {"x": -1.0 + 0.008 * step, "y": 0.0, "z": 1.0}
    turned = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
    health = {"frame": step, "verdict": "occluded" if gone else "ok", "capture_time": t - 0.004}
    recorder.write("pose", t, {**place, **turned, **health})
    if gone:
        return
    velocity = {"vx": 0.8, "vy": 0.0, "vz": 0.1}
    recorder.write("estimate", t, {**place, "z": 1.003, **velocity, **ms})
    recorder.write("estimate", t, {**turned, **ms})
    recorder.write("rates", t, {"gx": 0.1, "gy": -0.2, "gz": 0.3, **ms})
    recorder.write("motors", t, {"m1": 65535.0, "m2": 0.0, "m3": 6553.5, "m4": 32767.5, **ms})
    recorder.write("power", t, {"vbat": 3.9, **ms})
    flying = SupervisorBits.ARMED | SupervisorBits.FLYING
    bits = flying | SupervisorBits.TUMBLED if step >= FLIP else flying
    recorder.write("supervisor", t, {"bits": float(bits), **ms})
    state = LandingState.FLIP if step >= FLIP else LandingState.APPROACH
    recorder.write("cues", t, {"state": float(state), **ms})
    tau = 1.4e6 if step == 0 else -math.inf if step == 1 else 1.2 - 0.01 * step
    cues = {"tau": tau, "theta_x": 2.0, "d_ceil": room.ceiling_z - 1.0, "trigger_value": -0.1, "a_rot": -5e-3}
    recorder.write("cues", t, {**cues, **ms})
    if step == FLIP:
        recorder.write("trigger", t, {**cues, "count": 1.0, "tick_ms": 10.0 * step})
