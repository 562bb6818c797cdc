"""A check's record made of numbers: a drone in one place whose figures are known."""

from pathlib import Path

import numpy as np

from onboard.arrays import FloatArray
from onboard.battery import FULL_RATIO, voltage_from_thrust
from onboard.gravity import GRAVITY
from onboard.vehicle import load_vehicle
from perchhw.hover_check.windows import CheckWindows
from perchhw.record import RunRecord, Series

VEHICLE = load_vehicle("crazyflie21-upgraded")
AT_REST, HOVER, DOUBLETS = 3.0, 20.0, 9.0


def series(topic: str, t: FloatArray, **columns: FloatArray | float) -> Series:
    rows = np.column_stack([column * np.ones_like(t) for column in columns.values()])
    return Series(topic, t, tuple(dict(zip(columns, row.tolist(), strict=True)) for row in rows))


def windows(
    *,
    shares: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0),
    resistance: float = 0.23,
    shake: float = 0.0,
    lost: slice = slice(0, 0),
) -> CheckWindows:
    """A hover whose motors are asked for `shares` of a quarter of the weight by the vehicle's map; `shake`:
    rad/s rms of the gyro at 40 Hz; `lost`: poses of the hover that never came."""
    t = np.arange(0.0, AT_REST + HOVER + DOUBLETS, 0.01)
    weight = VEHICLE.body.mass.value * GRAVITY
    flying = t >= AT_REST
    asked = 0.25 * weight * np.array(shares)
    current = VEHICLE.battery.motor_current_per_newton.value * asked.sum()
    volts = 4.1 - np.where(flying, resistance * current + 0.004 * (t - AT_REST), 0.0)
    thrust_map = VEHICLE.motors.thrust_map_compiled()
    pwm = [
        np.where(flying, np.ceil(256.0 * voltage_from_thrust(thrust_map, one) / volts) * 256.0, 0.0)
        for one in asked
    ]
    assert max(map(np.max, pwm)) < FULL_RATIO
    ms = 1e3 * t
    frames = np.arange(float(len(t)))
    came = np.ones(len(t), dtype=bool)
    came[500:][lost] = False
    exposed = t[came] - 0.006
    run = RunRecord(
        folder=Path("numbers"),
        info={},
        series={
            "power": series("power", t, vbat=volts, drone_time_ms=ms),
            "motors": series(
                "motors", t, **{f"m{i + 1}": one for i, one in enumerate(pwm)}, drone_time_ms=ms
            ),
            "rates": series(
                "rates",
                t,
                gx=np.sqrt(2.0) * shake * np.sin(2.0 * np.pi * 40.0 * t),
                gy=0.0,
                gz=0.0,
                drone_time_ms=ms,
            ),
            "acceleration": series("acceleration", t, ax=0.0, ay=0.0, az=GRAVITY, drone_time_ms=ms),
            "pose": series("pose", t[came], frame=frames[came], capture_time=exposed, x=0.0),
        },
        events=(
            {"t": AT_REST, "event": "phase", "phase": "arming"},
            {"t": AT_REST, "event": "phase", "phase": "test flight"},
        ),
        torn=(),
    )
    return CheckWindows.of(run, HOVER, HOVER + DOUBLETS)
