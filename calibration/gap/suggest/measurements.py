"""What no flight can tell and a bench can: the measurement that decides between two effects."""

_SCALE = "weigh the drone ready to fly, to 0.1 g, and put the mass into the vehicle file"
_THRUST = "measure thrust over voltage on a stand (`perchhw calibrate thrust`)"
_BIFILAR = "swing the drone on two strings (`perchhw calibrate bifilar`)"
_TACHOMETER = "log steps of the rotor speed with a tachometer (`perchhw calibrate tachometer`)"
_BALANCE = "balance the drone on an edge along both axes"
_FRAME = "draw the tracked frame anew, with the drone level on a plate and its nose on a line"
_HINGE = "load a leg with known weights, and film it when it is let go"

MEASUREMENTS: dict[str, str] = {
    "thrust_scale": _THRUST,
    "thrust_curve": _THRUST,
    "motor_saturation": _THRUST,
    "motor_imbalance": _THRUST,
    "battery_sag": "measure the battery's voltage at rest and under the hover current",
    "motor_lag": _TACHOMETER,
    "motor_lag_asymmetry": _TACHOMETER,
    "motor_speed_law": _TACHOMETER,
    "command_delay": "log a step of PWM on board together with the rotor speed of a tachometer",
    "mass_error": _SCALE,
    "inertia_error": _BIFILAR,
    "com_offset": _BALANCE,
    "thrust_tilt": "stand the drone on a plate and check the motors' axes with a square",
    "pose_rotation": _FRAME,
    "pose_offset": _FRAME,
    "gyro_bias": "log the gyro on a table for ten seconds",
    "wind": "hold a thread into the flight volume, and switch the ventilation off",
    "rotor_gyroscopic": "weigh a propeller and take its inertia as that of a plate",
    "rotor_acceleration_torque": "weigh a propeller and take its inertia as that of a plate",
    "leg_stiffness": _HINGE,
    "leg_damping": _HINGE,
    "foot_slip": "pull a foot off the ceiling with a spring scale",
    "tether": "take off every string and cable",
}
"""By effect; effects of the air have none but flights."""


def measurement_for(first: str, second: str) -> str | None:
    """What decides between two effects on the ground, or None."""
    texts = dict.fromkeys(MEASUREMENTS[name] for name in (second, first) if name in MEASUREMENTS)
    return ", or ".join(texts) or None
