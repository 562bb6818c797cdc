"""Battery, motors and rotors of the hidden flights: from voltage to force and torque."""

import math
from typing import Any

import numpy as np

from tests.truth.hidden_effects.jit import Array, jitted
from tests.truth.hidden_effects.layout import AIR_DENSITY, FULL, MAP_CUBIC, MAP_QUADRATIC

MOST_GROUND_GAIN = 2.0


@jitted
def thrust_of(p: Any, volt: float) -> float:
    """Settled thrust (N) of a motor at a voltage (V)."""
    c = p.map
    if volt <= 0.0:
        return 0.0
    if p.map_form == MAP_QUADRATIC:
        low = (c[0] * volt + c[1]) * volt + c[2]
        high = (c[3] * volt + c[4]) * volt + c[5]
        if low < c[6]:  # the rows do not meet: the thrust waits at the break
            return max(low, 0.0)
        return max(high, c[6]) if volt > -0.5 * c[4] / c[3] else c[6]
    if p.map_form == MAP_CUBIC:
        return max(((c[3] * volt + c[2]) * volt + c[1]) * volt + c[0], 0.0)
    knee = c[0] * math.log1p(c[4] / c[1])
    if volt < knee:
        return c[1] * math.expm1(volt / c[0])
    return c[4] + (c[4] + c[3]) * math.expm1((volt - knee) / c[2])


@jitted
def settled_thrusts(p: Any, logged: Array) -> Array:
    """Thrusts (N) that motors head for at logged PWM and voltage (rows of m1..m4, vbat), shape (n, 4)."""
    out = np.empty((logged.shape[0], 4))
    for n in range(logged.shape[0]):
        for i in range(4):
            out[n, i] = thrust_of(p, logged[n, i] / FULL * logged[n, 4])
    return out


@jitted
def voltage_for(p: Any, thrust: float) -> float:
    """Motor voltage (V) that the controller takes for a thrust (N): table of the nominal map."""
    last = p.inverse.size - 1
    place = min(max(thrust / p.inverse_step, 0.0), last - 1e-9)
    k = int(place)
    return p.inverse[k] + (place - k) * (p.inverse[k + 1] - p.inverse[k])


@jitted
def terminal_voltage(p: Any, y: Array) -> float:
    """Battery voltage (V) under the load of the four rotors."""
    current = p.amps_per_newton * (y[13] + y[14] + y[15] + y[16])
    return p.full_volts - p.volts_per_coulomb * y[17] - p.ohms * current


@jitted
def surface_gain(p: Any, height: float, up: float) -> float:
    """Thrust near floor and ceiling over that in the open, for a hub at `height` (m), cosine of tilt `up`."""
    if up <= 0.0:
        return 1.0
    gain = 1.0
    if p.ceiling_inflow > 0.0:
        ratio = p.rotor_radius / (p.ceiling_opening * max(p.ceiling - height, 1e-6))
        b = p.ceiling_inflow / (0.5 * (1.0 + math.sqrt(1.0 + 0.125 * ratio * ratio)))
        root = 0.5 * (math.sqrt(b * b + 4.0 * (1.0 + p.ceiling_inflow)) - b)
        gain += up * (root * root - 1.0)
    if p.ground_strength > 0.0:
        mirror = p.ground_strength * (p.rotor_radius / (4.0 * max(height, 1e-6))) ** 2
        closest = 1.0 - 1.0 / MOST_GROUND_GAIN
        gain *= 1.0 + up * (1.0 / (1.0 - min(mirror, closest)) - 1.0)
    return gain


@jitted
def fresh_air_gain(p: Any, still: float, edgewise: float) -> float:
    """Thrust of a rotor that moves edgewise (m/s) over that in still air: Glauert's inflow, blade lift."""
    if p.lift_inflow == 0.0 or still <= 0.0:
        return 1.0
    hover = math.sqrt(still / (2.0 * AIR_DENSITY * math.pi)) / p.rotor_radius
    induced = hover
    for _ in range(40):  # halfway to the next estimate: it converges at any speed
        induced = 0.5 * (induced + hover * hover / math.sqrt(edgewise * edgewise + induced * induced))
    gain = 1.0
    for _ in range(20):  # Newton's method for gain + c sqrt(gain) = 1 + inflow
        c = p.lift_inflow * induced / hover
        gain -= (gain + c * math.sqrt(gain) - 1.0 - p.lift_inflow) / (1.0 + 0.5 * c / math.sqrt(gain))
    return gain


@jitted
def add_rotors(
    p: Any, y: Array, r: Array, wind_body: Array, rates: Array, force: Array, torque: Array
) -> None:
    """Add force and torque (body frame) of the rotors; `rates`: dF/dt of each (N/s)."""
    spin_sum, spin_change = 0.0, 0.0
    for i in range(4):
        hx, hy, hz = p.hub[i, 0], p.hub[i, 1], p.hub[i, 2]
        ux = wind_body[0] + y[11] * hz - y[12] * hy
        uy = wind_body[1] + y[12] * hx - y[10] * hz
        uz = wind_body[2] + y[10] * hy - y[11] * hx
        still = max(y[13 + i], 0.0)
        speed = math.sqrt(still / p.thrust_per_speed2)
        height = y[2] + r[2, 0] * hx + r[2, 1] * hy + r[2, 2] * hz
        fresh = fresh_air_gain(p, still, math.hypot(ux, uy))
        lift = still * surface_gain(p, height, r[2, 2]) * fresh - p.inflow_loss * speed * uz
        fx = lift * p.axis[0] - p.rotor_drag * speed * ux
        fy = lift * p.axis[1] - p.rotor_drag * speed * uy
        fz = lift * p.axis[2]
        force[0] += fx
        force[1] += fy
        force[2] += fz
        torque[0] += hy * fz - hz * fy
        torque[1] += hz * fx - hx * fz
        turning = 1.0 if i % 2 == 0 else -1.0  # M1 and M3 counter-clockwise from above
        torque[2] += hx * fy - hy * fx - turning * p.drag_torque * still
        spin_sum += turning * speed
        spin_change += turning * rates[i] / (2.0 * math.sqrt(p.thrust_per_speed2 * max(still, 1e-4)))
    torque[0] -= p.gyroscopic_inertia * spin_sum * y[11]
    torque[1] += p.gyroscopic_inertia * spin_sum * y[10]
    torque[2] -= p.accelerated_inertia * spin_change
