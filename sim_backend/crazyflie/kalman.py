"""The filter that a Crazyflie flies: nine coupled errors, predicted at 100 Hz, corrected by external poses.

After M. W. Mueller, M. Hamer, R. D'Andrea, "Fusing ultra-wideband range measurements with accelerometers and
rate gyroscopes for quadrocopter state estimation", ICRA 2015, and M. W. Mueller, M. Hehn, R. D'Andrea,
"Covariance correction step for Kalman filtering with an attitude", J. Guidance, Control, and Dynamics 40(9),
2017. The errors are those of position p (world), velocity v (body) and attitude d (rad, body), of

    dp/dt = R (1 + [d]) v,    dv/dt = f - w x v - g (1 - [d]) R' e3 - drag (v + w x r),

with [.] the matrix of a cross product, f the specific force, w the body rate, r the centre of pressure.
Rates, noise, bounds and what follows are facts of bitcraze/crazyflie-firmware 2a18fc29 (2026.08,
``estimator_kalman.c``, ``kalman_core.c``, ``kalman_core_params_defaults.h``, ``mm_pose.c``):

- an Euler step every 10 ms, from the means of the samples since the last one; in between nothing moves;
- the drone in flight counts the accelerometer's z alone, and drag (none, for a Crazyflie); any other one all
  three axes, and is pulled to the attitude it was reset to by 0.001 of the way a step;
- process noise comes every ms; a pose is six scalar corrections, one after the other;
- the residual of the attitude is 2 vec / w of the turn still to make: blind to sign and scale of the
  quaternion, singular at half a turn; it does not see what the corrections before it found;
- an attitude error below 0.1 mrad in all parts, or of 10 rad in one, is dropped and not made good;
- half of each turn goes into the errors' covariance, to second order;
- control has what the filter knew a ms ago.

Loop and filter have clocks of their own there, that of the inertial sensors and the processor's, so that
their phase wanders. Here it is fixed, and in the middle: the policy, in every tenth step, finds a prediction
that went out 5 ms ago.
"""

import numpy as np

from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY
from onboard.jit import APART, for_kernels, inner, kernel, outlined
from onboard.rotation import (
    Indexable,
    body_x,
    body_y,
    body_z,
    conjugate,
    integrate,
    multiply,
    normalise,
    rotate,
)

_called = for_kernels(**APART)  # inlined wherever they are used, these would take half a minute to compile

ERRORS = 9
PREDICTION_MS, FIRST_PREDICTION_MS = 10.0, 3.0
STEP_S = 0.001
MAX_COVARIANCE = 100.0
MIN_COVARIANCE = 1e-6
REVERSION = 0.001
LEAST_TURN, MOST_TURN = 1e-4, 10.0

# Layout of the memory. The first nine are what corrections act on, in the order of the covariance.
PLACE, SPEED, ERROR, ATTITUDE, UPRIGHT = 0, 3, 6, 9, 13
FORCE_SUM, RATE_SUM, SAMPLES, FORCE, RATE, LATEST_FORCE = 17, 20, 23, 24, 27, 30
TO_PREDICTION, SINCE_PREDICTION = 33, 34
MEMORY_SIZE = 35

# Layout of what control and logs get.
POSITION, VELOCITY, QUATERNION, ACCELERATION = 0, 3, 6, 10
P_POSITION, P_VELOCITY, P_ATTITUDE, BODY_VELOCITY = 13, 16, 19, 22
SIZE = 25

# Layout of a measurement: position, quaternion, their standard deviations, whether it has an attitude.
MEASUREMENT = 10
_DEVIATION, _ATTITUDE_DEVIATION, _HAS_ATTITUDE = 7, 8, 9


@kernel
def start(memory: FloatArray, covariance: FloatArray, position: Indexable, attitude: Indexable) -> None:
    """Begin anew at rest; the rhythm of the predictions goes on.

    Args:
        memory: (35,), in place.
        covariance: of the errors, (9, 9), in place: SI and rad, squared.
        position: m, world.
        attitude: quaternion, to which a drone that does not fly is pulled from now on.
    """
    memory[:TO_PREDICTION] = 0.0
    memory[SINCE_PREDICTION] = -1.0  # it begins with the next ms
    covariance[:, :] = 0.0
    for i in range(3):
        memory[PLACE + i] = position[i]
        covariance[i, i] = 1.0 if i == 2 else MAX_COVARIANCE
        covariance[SPEED + i, SPEED + i] = 1e-4
        covariance[ERROR + i, ERROR + i] = 1e-4
    for i in range(4):
        memory[ATTITUDE + i] = attitude[i]
        memory[UPRIGHT + i] = attitude[i]


@kernel
def publish(memory: FloatArray, covariance: FloatArray, state: FloatArray) -> None:
    """What control and logs get, into `state` (25,), SI: velocity and acceleration in the world frame."""
    q = _attitude(memory)
    speed = (memory[SPEED], memory[SPEED + 1], memory[SPEED + 2])
    velocity = rotate(q, speed)
    force = rotate(q, (memory[LATEST_FORCE], memory[LATEST_FORCE + 1], memory[LATEST_FORCE + 2]))
    for i in range(3):
        state[POSITION + i] = memory[PLACE + i]
        state[VELOCITY + i] = velocity[i]
        state[ACCELERATION + i] = force[i]
        state[P_POSITION + i] = covariance[PLACE + i, PLACE + i]
        state[P_VELOCITY + i] = covariance[SPEED + i, SPEED + i]
        state[P_ATTITUDE + i] = covariance[ERROR + i, ERROR + i]
        state[BODY_VELOCITY + i] = speed[i]
    state[ACCELERATION + 2] -= GRAVITY
    for i in range(4):
        state[QUATERNION + i] = q[i]


@outlined
def run(
    memory: FloatArray,
    covariance: FloatArray,
    state: FloatArray,
    noise: FloatArray,
    drag: FloatArray,
    acc: FloatArray,
    gyro: FloatArray,
    flying: bool,
    measurements: FloatArray,
    count: int,
    max_position: float,
    max_velocity: float,
) -> bool:
    """One ms, in place; whether the filter is now out of bounds.

    Args:
        memory, covariance: as of :func:`start`.
        state: (25,); becomes what was known before this ms.
        noise: standard deviations: acceleration xy and z [m/s2], gyro roll/pitch and yaw [rad/s], and what
            each ms adds to velocity [m/s; with the time to position as well], position [m], attitude [rad].
        drag: of body x, y, z [1/s], then the centre of pressure [m, body].
        acc: accelerometer (3,), m/s2, body.
        gyro: rate gyro (3,), rad/s, body.
        flying: what the supervisor says.
        measurements: (n, 10); the first `count` are taken in.
        max_position, max_velocity: m and, along each axis of the body, m/s; 0: no bound.
    """
    publish(memory, covariance, state)
    memory[SINCE_PREDICTION] += 1.0
    due = memory[TO_PREDICTION] <= 0.0
    if due:
        _predict(memory, covariance, drag, flying)
        memory[TO_PREDICTION] = PREDICTION_MS
    memory[TO_PREDICTION] -= 1.0
    _diffuse(covariance, noise)
    for k in range(count):
        _take_in(memory, covariance, measurements[k])
    for i in range(3):
        memory[FORCE_SUM + i] += acc[i]
        memory[RATE_SUM + i] += gyro[i]
        memory[LATEST_FORCE + i] = acc[i]
    memory[SAMPLES] += 1.0
    if due or count > 0:
        _make_good(memory, covariance)
    return _is_beyond(memory, PLACE, max_position) or _is_beyond(memory, SPEED, max_velocity)


@inner
def _is_beyond(memory: FloatArray, first: int, bound: float) -> bool:
    """Whether one of three left its bound (NaN does not, as in the firmware)."""
    x, y, z = abs(memory[first]), abs(memory[first + 1]), abs(memory[first + 2])
    return bound > 0.0 and (x > bound or y > bound or z > bound)


@inner
def _attitude(memory: FloatArray) -> tuple[float, float, float, float]:
    return (memory[ATTITUDE], memory[ATTITUDE + 1], memory[ATTITUDE + 2], memory[ATTITUDE + 3])


@_called
def _bound(covariance: FloatArray) -> None:
    """Symmetric and within the firmware's bounds (NaN becomes the upper one)."""
    for i in range(ERRORS):
        for j in range(i, ERRORS):
            p = 0.5 * (covariance[i, j] + covariance[j, i])
            if not p <= MAX_COVARIANCE:
                p = MAX_COVARIANCE
            elif i == j and p < MIN_COVARIANCE:
                p = MIN_COVARIANCE
            covariance[i, j] = p
            covariance[j, i] = p


@_called
def _diffuse(covariance: FloatArray, noise: FloatArray) -> None:
    """The process noise of one ms."""
    dt = STEP_S
    for i in range(3):
        a = noise[1] if i == 2 else noise[0]
        g = noise[3] if i == 2 else noise[2]
        covariance[PLACE + i, PLACE + i] += (a * dt * dt + noise[4] * dt + noise[5]) ** 2
        covariance[SPEED + i, SPEED + i] += (a * dt + noise[4]) ** 2
        covariance[ERROR + i, ERROR + i] += (g * dt + noise[6]) ** 2
    _bound(covariance)


@_called
def _half_turn(transition: FloatArray, x: float, y: float, z: float) -> None:
    """What a turn by (x, y, z) rad does to attitude errors: half of it, to second order, backwards."""
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    transition[6, 6] = 1.0 - 0.5 * (y * y + z * z)
    transition[7, 7] = 1.0 - 0.5 * (x * x + z * z)
    transition[8, 8] = 1.0 - 0.5 * (x * x + y * y)
    transition[6, 7], transition[7, 6] = 0.5 * x * y + z, 0.5 * x * y - z
    transition[7, 8], transition[8, 7] = 0.5 * y * z + x, 0.5 * y * z - x
    transition[8, 6], transition[6, 8] = 0.5 * x * z + y, 0.5 * x * z - y


@_called
def _propagate(covariance: FloatArray, transition: FloatArray) -> None:
    """covariance <- F covariance F'; F has nothing below its diagonal of three blocks of three."""
    half = np.empty((ERRORS, ERRORS))
    for i in range(ERRORS):
        first = i - i % 3
        for j in range(ERRORS):
            total = 0.0
            for k in range(first, ERRORS):
                total += transition[i, k] * covariance[k, j]
            half[i, j] = total
    for i in range(ERRORS):
        for j in range(ERRORS):
            total = 0.0
            for k in range(j - j % 3, ERRORS):
                total += half[i, k] * transition[j, k]
            covariance[i, j] = total


@_called
def _identity() -> FloatArray:
    matrix = np.zeros((ERRORS, ERRORS))
    for i in range(ERRORS):
        matrix[i, i] = 1.0
    return matrix


@_called
def _predict(memory: FloatArray, covariance: FloatArray, drag: FloatArray, flying: bool) -> None:
    """One Euler step over the time since the last one."""
    dt = 0.001 * memory[SINCE_PREDICTION]
    memory[SINCE_PREDICTION] = 0.0
    _average(memory)
    q = _attitude(memory)
    columns = (body_x(q), body_y(q), body_z(q))
    up = (columns[0][2], columns[1][2], columns[2][2])
    v = (memory[SPEED], memory[SPEED + 1], memory[SPEED + 2])
    w = (memory[RATE], memory[RATE + 1], memory[RATE + 2])
    force = (memory[FORCE], memory[FORCE + 1], memory[FORCE + 2])
    slowed = (0.0, 0.0, 0.0)
    if flying:
        force = (0.0, 0.0, force[2])
        slowed = (drag[0], drag[1], drag[2])

    transition = _identity()
    for i in range(3):
        x, y, z = columns[0][i], columns[1][i], columns[2][i]
        transition[i, 3], transition[i, 4], transition[i, 5] = dt * x, dt * y, dt * z
        transition[i, 6] = dt * (v[1] * z - v[2] * y)
        transition[i, 7] = dt * (v[2] * x - v[0] * z)
        transition[i, 8] = dt * (v[0] * y - v[1] * x)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        transition[3 + i, 3 + i] -= dt * slowed[i]
        transition[3 + i, 3 + j], transition[3 + i, 3 + k] = dt * w[k], -dt * w[j]
        transition[3 + i, 6 + j], transition[3 + i, 6 + k] = dt * GRAVITY * up[k], -dt * GRAVITY * up[j]
    _half_turn(transition, dt * w[0], dt * w[1], dt * w[2])
    _propagate(covariance, transition)

    moved = rotate(q, (dt * v[0], dt * v[1], dt * v[2]))
    pushed = rotate(q, force)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        weight = GRAVITY if i == 2 else 0.0
        memory[PLACE + i] += moved[i] + 0.5 * dt * dt * (pushed[i] - weight)
        wind = v[i] + w[j] * drag[3 + k] - w[k] * drag[3 + j]
        turning = w[j] * v[k] - w[k] * v[j]
        memory[SPEED + i] += dt * (force[i] - turning - GRAVITY * up[i] - slowed[i] * wind)
    turned = integrate(q, w, dt)
    if not flying:
        turned = _towards(turned, memory)
    for i in range(4):
        memory[ATTITUDE + i] = turned[i]


@_called
def _average(memory: FloatArray) -> None:
    """The samples' means since the last time; without a sample, what they were."""
    count = memory[SAMPLES]
    if count > 0.0:
        for i in range(3):
            memory[FORCE + i] = memory[FORCE_SUM + i] / count
            memory[RATE + i] = memory[RATE_SUM + i] / count
            memory[FORCE_SUM + i] = 0.0
            memory[RATE_SUM + i] = 0.0
        memory[SAMPLES] = 0.0


@_called
def _towards(q: Indexable, memory: FloatArray) -> tuple[float, float, float, float]:
    """A little of the way to upright, number by number: blind to the quaternion's sign, as the firmware."""
    keep, pull = 1.0 - REVERSION, REVERSION
    return normalise(
        (
            keep * q[0] + pull * memory[UPRIGHT],
            keep * q[1] + pull * memory[UPRIGHT + 1],
            keep * q[2] + pull * memory[UPRIGHT + 2],
            keep * q[3] + pull * memory[UPRIGHT + 3],
        )
    )


@_called
def _take_in(memory: FloatArray, covariance: FloatArray, measurement: FloatArray) -> None:
    for i in range(3):
        error = measurement[i] - memory[PLACE + i]
        _correct(memory, covariance, PLACE + i, error, measurement[_DEVIATION])
    if measurement[_HAS_ATTITUDE] > 0.0:
        measured = (measurement[3], measurement[4], measurement[5], measurement[6])
        residual = multiply(conjugate(_attitude(memory)), measured)
        for i in range(3):
            error = 2.0 / residual[3] * residual[i]
            _correct(memory, covariance, ERROR + i, error, measurement[_ATTITUDE_DEVIATION])


@_called
def _correct(memory: FloatArray, covariance: FloatArray, index: int, error: float, deviation: float) -> None:
    """One scalar: the error of state `index` was measured."""
    total = covariance[index, index] + deviation * deviation
    known = np.empty(ERRORS)
    for i in range(ERRORS):
        known[i] = covariance[i, index]
        memory[i] += known[i] / total * error
    for i in range(ERRORS):
        for j in range(ERRORS):
            covariance[i, j] -= known[i] * known[j] / total
    _bound(covariance)


@_called
def _make_good(memory: FloatArray, covariance: FloatArray) -> None:
    """The attitude error goes into the attitude, and the covariance turns with it."""
    x, y, z = memory[ERROR], memory[ERROR + 1], memory[ERROR + 2]
    a, b, c = abs(x), abs(y), abs(z)
    counts = a > LEAST_TURN or b > LEAST_TURN or c > LEAST_TURN
    if counts and a < MOST_TURN and b < MOST_TURN and c < MOST_TURN:
        turned = integrate(_attitude(memory), (x, y, z), 1.0)
        for i in range(4):
            memory[ATTITUDE + i] = turned[i]
        transition = _identity()
        _half_turn(transition, x, y, z)
        _propagate(covariance, transition)
    for i in range(3):
        memory[ERROR + i] = 0.0
    _bound(covariance)
