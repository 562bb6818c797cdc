"""Records with real content: simulated landings written through the recorder."""

from pathlib import Path

from onboard.vehicle import Vehicle
from perchhw.record import RunRecorder
from tests.label.simulated import Landing

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def record_landing(landing: Landing, folder: Path, vehicle: Vehicle, speed: float, angle_deg: float) -> Path:
    """Write `landing` as the flight writes its record; the cues come from the pose and velocity."""
    flight, ceiling_z = landing.flight, landing.flight.ceiling_z or 0.0
    config = {
        "speed_m_s": speed,
        "angle_deg": angle_deg,
        "ceiling_z": ceiling_z,
        "vehicle": vehicle.name,
        "legs": None if vehicle.legs is None else vehicle.legs.design,
        "drone": "udp://127.0.0.1:19850",
    }
    assert flight.trigger is not None
    fired = round(flight.trigger.t * 100)
    with RunRecorder(folder, config, clock=lambda: 0.0) as recorder:
        for i, t in enumerate(flight.t):
            row = {name: float(values[i]) for name, values in flight.data.items()}
            recorder.write("pose", t, {**{n: row[n] for n in POSE}, "frame": i, "verdict": "OK"})
            recorder.write("rates", t, {n: row[n] for n in ("gx", "gy", "gz")})
            recorder.write("estimate", t, {n: row[n] for n in ("x", "y", "z", "vx", "vy", "vz")})
            if i <= fired:
                recorder.write("cues", t, cues(row, ceiling_z))
            recorder.write("power", t, {"vbat": 3.9 - 0.05 * float(t)})
        snapshot = {**cues(row_at(landing, fired), ceiling_z), "count": 1, "tick_ms": fired * 10}
        recorder.write("trigger", float(flight.t[fired]), {k: v for k, v in snapshot.items() if k != "state"})
        recorder.event("phase", float(flight.t[fired]), phase="flipping")
        recorder.close(outcome=landing.truth, triggered=True, trigger=snapshot)
    return folder


def row_at(landing: Landing, i: int) -> dict[str, float]:
    return {name: float(values[i]) for name, values in landing.flight.data.items()}


def cues(row: dict[str, float], ceiling_z: float) -> dict[str, float]:
    d_ceil = ceiling_z - row["z"]
    tau = d_ceil / row["vz"]
    return {
        "tau": tau,
        "theta_x": row["vx"] / d_ceil,
        "d_ceil": d_ceil,
        "trigger_value": 0.3 - tau,
        "a_rot": -6.0e-3,
        "state": 2,
    }
