"""What the vehicle file, and a good motion capture, let a check expect."""

import math

from calibration.measurement import Estimate
from onboard.quantity import Quantity
from onboard.vehicle import Vehicle
from perchhw.hover_check.lag import GYRO_CUTOFF_HZ
from perchhw.hover_check.vibration import ACCELEROMETER_CUTOFF_HZ, noise_in_band

MOTOR_TO_MOTOR = 0.04
"""Standard deviation of the thrust of motors of one kind: 3 to 5 % (effect ``motor_imbalance``)."""
MAP = 0.03
"""Standard deviation of a motor's thrust about its map (``thrust_maps.toml``). The coefficients' own sigmas,
taken as independent, would say 10 %: they are those of one fit, whose covariance nobody kept."""
TURN = math.radians(1.0)
"""rad: markers are put on within 2 deg."""
COASTING_S = 0.03
"""s without a pose after which the drone coasts (docs/mocap.md)."""
LATE_S = 0.035
"""s of age that are counted as late (docs/mocap.md)."""
_FRAME_S = 0.01
_SHARE_MISSING = 0.01


def expected(vehicle: Vehicle) -> dict[str, Estimate]:
    """By name of the held quantity; those that no file says are absent."""
    motors, battery, sensing = vehicle.motors, vehicle.battery, vehicle.sensing
    imbalance = _effect(vehicle, "motor_imbalance", ("m1", "m2", "m3", "m4"), 1.0)
    bias = _effect(vehicle, "gyro_bias", ("x", "y", "z"), 0.0)
    lag = 0.5 * (_relative(motors.time_constant_up) + _relative(motors.time_constant_down))
    gyro = noise_in_band(sensing.gyro_noise.value, GYRO_CUTOFF_HZ)
    force = noise_in_band(sensing.accelerometer_noise.value, ACCELEROMETER_CUTOFF_HZ)
    late = Estimate(0.5 * LATE_S, "s", 0.5 * LATE_S / math.sqrt(3.0))
    values = {
        "thrust": Estimate(1.0, "1", math.hypot(_relative(vehicle.body.mass), MAP)),
        "motor_lag": Estimate(1.0, "1", lag),
        "battery_resistance": Estimate.from_quantity(battery.resistance),
        "vibration_gyro": Estimate(gyro, "rad/s", gyro * _relative(sensing.gyro_noise)),
        "vibration_accelerometer": Estimate(force, "m/s2", force * _relative(sensing.accelerometer_noise)),
        "mocap_missing": Estimate(0.0, "1", _SHARE_MISSING),
        "mocap_longest_gap": Estimate(_FRAME_S, "s", 0.5 * (COASTING_S - _FRAME_S)),
        "mocap_age": late,
        "mocap_jitter": Estimate(0.0, "s", 0.25 * LATE_S),
        "mocap_latency": Estimate(0.0, "s", 0.005),
    }
    for number, value in enumerate(imbalance, 1):
        values[f"motor_{number}"] = Estimate(1.0 / value, "1", MOTOR_TO_MOTOR)
    for axis, value in zip("xyz", bias, strict=True):
        values[f"mocap_turn_{axis}"] = Estimate(0.0, "rad", TURN)
        values[f"gyro_bias_{axis}"] = Estimate(value, "rad/s", 0.005)
    return values


def _effect(vehicle: Vehicle, name: str, keys: tuple[str, ...], neutral: float) -> list[float]:
    """Parameters of an effect of the vehicle file; `neutral` where it has none."""
    effect = next((one for one in vehicle.effects if one.name == name), None)
    return [neutral if effect is None else effect.values()[key] for key in keys]


def _relative(quantity: Quantity) -> float:
    return quantity.sigma / quantity.value if quantity.value else 0.0
