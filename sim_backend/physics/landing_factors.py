"""The four factors that decide an inverted landing (paper section V.E), from the state at the first contact.

Everything is taken in the pitch plane of the body, with rigid legs and both feet of the leading pair (the
fore feet after a nose-up flip) caught at once, so that closed forms hold; roll and hinge flexure are left
out. With

    beta        nose-up angle between b_z and the vertical: 0 level, pi inverted,
    (f_x, f_z)  a leading foot in the body frame, f_x > 0, f_z < 0, r its radius,
    m, I        mass and pitch inertia, g gravity,

a body point (x, z) is x sin(beta) + z cos(beta) above the centre of mass. An attitude past pi is mirrored:
the hind feet lead, and beta is 2 pi - beta. docs/leg_study.md explains the numbers.
"""

import math
from typing import Any

import numpy as np

from sim_backend.physics.jit import inner, kernel

FACTORS = np.dtype(
    [
        ("tilt", "f8"),  # rad, beta at the first contact, 0..pi
        ("fore", "i8"),  # 1: the fore feet lead; 0: past inverted, the hind feet do
        ("foot_first", "i8"),  # 1: inside the impact window, so a foot touches before hull and propellers
        ("swing_angle", "f8"),  # rad, pi - beta: what the body must turn until the other feet touch
        ("swing_distance", "f8"),  # m, arc of the other feet on the way: 2 f_x (pi - beta)
        ("gravity_height", "f8"),  # m, drop of the centre of mass from the contact to four-leg rest
        ("gravity_energy", "f8"),  # J, m g gravity_height, positive helps
        ("swing_rate", "f8"),  # rad/s about the leading feet after a plastic capture, positive closes
        ("rate_translation", "f8"),  # rad/s of it from the flight velocity
        ("rate_rotation", "f8"),  # rad/s of it from the body rate
        ("swing_energy", "f8"),  # J, kinetic energy of the swing after the capture
        ("energy_kept", "f8"),  # swing energy per kinetic energy before the contact
        ("energy_required", "f8"),  # J that gravity takes on the way to four feet, 0 where it helps
        ("energy_surplus", "f8"),  # J left at four feet, swing_energy + gravity_energy: closes when positive
        ("sufficiency", "f8"),  # swing_energy / energy_required; inf where nothing is required
        ("window_low", "f8"),  # rad, least tilt at which a leading foot touches first; the window ends at pi
        ("window_margin", "f8"),  # rad, tilt - window_low: how far inside; negative: hull or propeller first
    ],
    align=True,
)


@kernel
def fore_foot(p: Any) -> tuple[float, float]:
    """Centre of a fore foot at rest in the pitch plane of the body: f_x, f_z (m)."""
    return (
        p.hip[0, 0] + p.leg_length * p.leg_direction[0, 0],
        p.hip[0, 2] + p.leg_length * p.leg_direction[0, 2],
    )


@inner
def blocked_below(dx: float, dz: float, radius: float) -> float:
    """Tilt (rad) from which a foot touches before a body point that lies (dx, dz) (m) from its centre.

    The foot is first where dx sin(beta) + dz cos(beta) < radius, that is M cos(beta - phi) < radius with
    M = hypot(dx, dz), phi = atan2(dx, dz): from beta = phi + acos(radius / M) on.
    """
    size = math.hypot(dx, dz)
    if size <= radius:
        return 0.0
    return math.atan2(dx, dz) + math.acos(radius / size)


@kernel
def window_low(p: Any) -> float:
    """Least tilt (rad) at which a fore foot touches the ceiling before hull and propellers; at most pi."""
    foot_x, foot_z = fore_foot(p)
    low = blocked_below(p.arm_x + p.rim_radius - foot_x, p.propeller_height_z - foot_z, p.foot_radius)
    low = max(low, blocked_below(p.body_half_x - foot_x, p.body_top_z - foot_z, p.foot_radius))
    low = max(low, blocked_below(p.body_half_x - foot_x, p.body_bottom_z - foot_z, p.foot_radius))
    return min(max(low, 0.0), math.pi)


@inner
def pitch_plane(q: Any, x: float, y: float, z: float) -> tuple[float, float]:
    """Components along b_x and b_z of a world vector, for the attitude quaternion q (x, y, z, w)."""
    bx = (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])) * x
    bx += 2.0 * (q[0] * q[1] + q[2] * q[3]) * y + 2.0 * (q[0] * q[2] - q[1] * q[3]) * z
    bz = 2.0 * (q[0] * q[2] + q[1] * q[3]) * x + 2.0 * (q[1] * q[2] - q[0] * q[3]) * y
    bz += (1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1])) * z
    return bx, bz


@inner
def swing_and_gravity(p: Any, tilt: float, out: Any) -> None:
    """Swing distance, gravity's contribution and impact window of a tilt (rad) into `out`."""
    foot_x, foot_z = fore_foot(p)
    out.tilt = tilt
    out.swing_angle = math.pi - tilt
    out.swing_distance = 2.0 * foot_x * out.swing_angle
    # Below the feet's plane by f_x sin + f_z cos at the contact, by -f_z hanging on four legs.
    out.gravity_height = -foot_z - (foot_x * math.sin(tilt) + foot_z * math.cos(tilt))
    out.gravity_energy = p.mass * p.gravity * out.gravity_height
    out.energy_required = max(0.0, -out.gravity_energy)
    out.window_low = window_low(p)
    out.window_margin = tilt - out.window_low
    out.foot_first = 1 if out.window_margin >= 0.0 else 0


@inner
def momentum_transfer(p: Any, vx: float, vz: float, nose_up: float, out: Any) -> None:
    """Plastic capture of the leading feet into `out`, which holds gravity's part already.

    The angular momentum about the feet's axis survives: H = m (f_z v_x - f_x v_z) + I w, and the swing starts
    with H / (I + m (f_x^2 + f_z^2)).

    Args:
        p: parameters.
        vx, vz: m/s, velocity along b_x and b_z (mirrored where the hind feet lead).
        nose_up: rad/s, body rate that raises the leading feet's side.
        out: record of :data:`FACTORS`.
    """
    foot_x, foot_z = fore_foot(p)
    inertia = p.inertia[1] + p.mass * (foot_x * foot_x + foot_z * foot_z)
    out.rate_translation = p.mass * (foot_z * vx - foot_x * vz) / inertia
    out.rate_rotation = p.inertia[1] * nose_up / inertia
    out.swing_rate = out.rate_translation + out.rate_rotation
    out.swing_energy = 0.5 * inertia * out.swing_rate**2
    before = 0.5 * p.mass * (vx * vx + vz * vz) + 0.5 * p.inertia[1] * nose_up * nose_up
    out.energy_kept = out.swing_energy / before if before > 0.0 else 0.0
    out.energy_surplus = out.swing_energy + out.gravity_energy
    out.sufficiency = out.swing_energy / out.energy_required if out.energy_required > 0.0 else math.inf


@kernel
def landing_factors(state: Any, p: Any, out: Any) -> None:
    """The factors of a landing.

    Where hull or propeller touched first, swing and momentum are those of the same attitude and velocities
    with the feet at the ceiling: what the landing would have had to do.

    Args:
        state: record of :data:`sim_backend.physics.state.STATE` that has touched the ceiling.
        p: physics parameters of its vehicle, with legs.
        out: record of :data:`FACTORS`; receives the result.
    """
    q, v = state.impact_quaternion, state.impact_velocity
    up_x, up_z = pitch_plane(q, 0.0, 0.0, 1.0)
    vx, vz = pitch_plane(q, v[0], v[1], v[2])
    # Nose up is a negative rate about b_y; past inverted, front and back change places.
    side = 1.0 if up_x >= 0.0 else -1.0
    out.fore = 1 if up_x >= 0.0 else 0
    swing_and_gravity(p, math.atan2(side * up_x, up_z), out)
    momentum_transfer(p, side * vx, vz, -side * state.impact_omega[1], out)
