"""Rates, set-point columns, and the parameters of the true vehicle as one record of float64 numbers."""

from enum import IntEnum

import numpy as np

from onboard.vehicle import Vehicle, load_vehicle

CONTROL_PERIOD = 0.002
"""s between two runs of the controller."""
SUBSTEPS = 4
"""RK4 steps per run of the controller: 2 kHz."""
TICKS_PER_SAMPLE = 5
"""Runs of the controller per row of the log and per pose: 100 Hz."""
STATES = 19
MOTORS = slice(13, 17)
"""Where the rotors' thrusts are in the state."""
MAP_QUADRATIC, MAP_CUBIC, MAP_LOG = 0, 1, 2
CEILING = 2.1
GRAVITY = 9.81
AIR_DENSITY = 1.2
FULL = 65535.0
"""Full scale of a motor command."""
INVERSE_POINTS = 4096


class Setpoint(IntEnum):
    """Columns of a set-point row: pose and its rates, added attitude (rad) and rates (rad/s), overrides."""

    X = 0
    Y = 1
    Z = 2
    VX = 3
    VY = 4
    VZ = 5
    AX = 6
    AY = 7
    AZ = 8
    YAW = 9
    ROLL = 10
    PITCH = 11
    P = 12
    Q = 13
    R = 14
    COLLECTIVE = 15  # share of the filed weight that overrides the height loop; negative: none
    ARMED = 16


_SCALARS = """
    map_form inverse_step thrust_limit curvature hover_thrust tau_up tau_down drag_torque thrust_per_speed2
    full_volts volts_per_coulomb ohms amps_per_newton capacity mass command_delay
    rotor_radius ceiling ceiling_inflow ceiling_opening ground_strength rotor_drag inflow_loss
    gyroscopic_inertia accelerated_inertia tether_length tether_stiffness tether_damping line_hertz
    lift_inflow floor_stiffness floor_damping filed_mass thrust_floor thrust_ceiling rate_filter
    gyro_noise accelerometer_noise voltage_noise position_noise attitude_noise gyro_count accelerometer_count
    pose_delay warming_loss warming_time
"""
_ARRAYS: dict[str, tuple[int, ...]] = {
    "map": (8,),
    "inverse": (INVERSE_POINTS,),
    "inertia": (3,),
    "hub": (4, 3),
    "corner": (8, 3),
    "axis": (3,),
    "gain": (4,),
    "trim": (3,),
    "linear_drag": (3,),
    "blunt_area": (3,),
    "wind": (3,),
    "velocity_moment": (2,),
    "rate_damping": (3,),
    "tether_end": (3,),
    "region": (2,),
    "region_force": (3,),
    "line_torque": (3,),
    "tracked": (3,),
    "pose_turn": (3,),
    "imu": (3,),
    "gyro_bias": (3,),
    "accelerometer_bias": (3,),
    "filed_inertia": (3,),
    "filed_arm": (2,),
    "gains": (14,),
}
PARAMETERS = np.dtype(
    [(name, "f8") for name in _SCALARS.split()] + [(name, "f8", shape) for name, shape in _ARRAYS.items()]
)

# Position xy (P, D, I), z (P, D, I); attitude, yaw; rate xy (P, I, D), z (P, I, D).
GAINS = (5.0, 3.6, 1.0, 40.0, 12.0, 20.0, 7.0, 3.0, 60.0, 60.0, 1.8, 20.0, 10.0, 0.2)
FORMS = {"quadratic_inverse": MAP_QUADRATIC, "firmware_cubic": MAP_CUBIC, "two_region_log": MAP_LOG}
KEYS = {
    MAP_QUADRATIC: ("low_a", "low_b", "low_c", "high_a", "high_b", "high_c", "break_thrust"),
    MAP_CUBIC: ("c0", "c1", "c2", "c3"),
    MAP_LOG: ("a1", "b1", "a2", "b2", "break_thrust"),
}


def nominal(name: str) -> np.ndarray:
    """The vehicle of that name as its file says, with ordinary sensors: record of :data:`PARAMETERS`."""
    vehicle = load_vehicle(name)
    p = np.zeros(1, PARAMETERS)[0]
    _fill_body(p, vehicle)
    _fill_power(p, vehicle)
    _fill_controller(p)
    p["gyro_noise"], p["accelerometer_noise"], p["voltage_noise"] = 0.01, 0.05, 0.005
    p["position_noise"], p["attitude_noise"] = 0.0002, np.deg2rad(0.17)
    p["gyro_count"], p["accelerometer_count"] = np.deg2rad(2000.0) / 32768, 24 * 9.80665 / 32768
    return p


def _fill_body(p: np.ndarray, vehicle: Vehicle) -> None:
    body = vehicle.body
    ax, ay, hub_z = body.arm_x.value, body.arm_y.value, body.propeller_height_z.value
    p["mass"] = body.mass.value
    p["inertia"] = (body.inertia_xx.value, body.inertia_yy.value, body.inertia_zz.value)
    p["hub"] = [(ax, -ay, hub_z), (-ax, -ay, hub_z), (-ax, ay, hub_z), (ax, ay, hub_z)]
    half = (body.body_half_x.value, body.body_half_y.value)
    faces = (body.body_bottom_z.value, body.body_top_z.value)
    p["corner"] = [(sx * half[0], sy * half[1], z) for sx in (-1, 1) for sy in (-1, 1) for z in faces]
    p["axis"] = (0.0, 0.0, 1.0)
    p["gain"] = 1.0
    p["warming_time"] = np.inf
    p["linear_drag"] = (vehicle.air.drag_x.value, vehicle.air.drag_y.value, vehicle.air.drag_z.value)
    p["rotor_radius"] = body.propeller_radius.value
    p["ceiling"], p["ceiling_opening"] = CEILING, 1.0
    p["region"] = (np.inf, np.inf)
    # Soft enough for the step, stiff enough that the hull sinks half a millimetre in.
    p["floor_stiffness"] = p["mass"] * GRAVITY / 4 / 5e-4
    p["floor_damping"] = 0.7 * np.sqrt(p["floor_stiffness"] * p["mass"])


def _fill_power(p: np.ndarray, vehicle: Vehicle) -> None:
    motors, battery = vehicle.motors, vehicle.battery
    form = FORMS[motors.thrust_map.form.name.lower()]
    p["map_form"] = form
    for index, key in enumerate(KEYS[form]):
        p["map"][index] = motors.thrust_map.coefficients[key].value
    p["drag_torque"] = motors.thrust_to_torque.value
    p["tau_up"], p["tau_down"] = motors.time_constant_up.value, motors.time_constant_down.value
    p["thrust_per_speed2"] = motors.thrust_coefficient.value if motors.thrust_coefficient else np.nan
    p["hover_thrust"], p["thrust_limit"] = p["mass"] * GRAVITY / 4, np.inf
    p["thrust_floor"] = max(motors.thrust_min.value * 1.5, 0.2 * p["hover_thrust"])
    p["thrust_ceiling"] = motors.thrust_max.value
    p["full_volts"], p["ohms"] = battery.open_circuit_full.value, battery.resistance.value
    p["capacity"] = battery.capacity.value
    p["volts_per_coulomb"] = battery.open_circuit_slope.value / battery.capacity.value
    p["amps_per_newton"] = battery.motor_current_per_newton.value


def _fill_controller(p: np.ndarray) -> None:
    """What the drone believes about itself: the file's numbers."""
    from tests.truth.hidden_effects.rotors import thrust_of

    p["filed_mass"], p["filed_inertia"] = p["mass"], p["inertia"]
    p["filed_arm"] = (p["hub"][3, 0], p["hub"][3, 1])
    p["gains"] = GAINS
    p["rate_filter"] = 1.0 - np.exp(-2 * np.pi * 30.0 * CONTROL_PERIOD)
    volts = np.linspace(0.0, 6.0, 6001)
    thrust = np.array([thrust_of(p, v) for v in volts])
    rising = np.flatnonzero(np.diff(thrust, prepend=-1.0) > 0.0)
    p["inverse_step"] = 1.5 * p["thrust_ceiling"] / (INVERSE_POINTS - 1)
    p["inverse"] = np.interp(np.arange(INVERSE_POINTS) * p["inverse_step"], thrust[rising], volts[rising])
