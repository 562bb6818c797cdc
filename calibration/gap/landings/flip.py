"""The flip before the contact: pitch rate predicted from the logged commands, against the gyro.

Free of contact and short, it shows what motors and pitch inertia are worth. Variants of the model say which
of them the logs could tell apart: a difference below that of a few milliseconds of timing they cannot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.landings.kernels import COLUMNS, DT, OMEGA, fly
from calibration.gap.landings.segments import LandingSegment, commanded_thrusts, on_steps, running_until
from calibration.gap.replay.inputs import below_no_ceiling
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle
from sim_backend.physics.state import new_states

LONGEST = 0.24
"""s of a flip that are compared, as in the authors' check."""

_LEAST_SAMPLES = 7
_COMMAND_ROW = 0.03  # s: commands this close to the trigger may still be those of the approach


class Variant(NamedTuple):
    """A change of the model.

    Attributes:
        up, down: factors on the motors' time constants. pitch_inertia: factor on that.
        late: s by which the commands act later than logged.
    """

    up: float = 1.0
    down: float = 1.0
    pitch_inertia: float = 1.0
    late: float = 0.0


VARIANTS: Mapping[str, Variant] = {
    "as filed": Variant(),
    "spin-down 7 % slower": Variant(down=0.16 / 0.15),
    "spin-up 20 %, spin-down 7 % slower": Variant(up=1.2, down=0.16 / 0.15),
    "spin-down as quick as spin-up": Variant(down=1.0 / 3.0),
    "no motor lag": Variant(up=1e-2, down=1e-2),
    "pitch inertia 10 % smaller": Variant(pitch_inertia=0.9),
    "pitch inertia 10 % larger": Variant(pitch_inertia=1.1),
    "commands 5 ms later": Variant(late=0.005),
    "commands 10 ms later": Variant(late=0.01),
}


@dataclass(frozen=True)
class FlipResidual:
    """Pitch rate, model minus gyro, over all flips.

    Attributes:
        flights: flips that were compared. samples: of the gyro.
        mean, rms: rad/s, by variant.
        judgement: what these flips can and cannot tell, in words.
    """

    flights: tuple[str, ...]
    samples: int
    mean: Mapping[str, float]
    rms: Mapping[str, float]
    judgement: tuple[str, ...]


def flip_residual(landings: Sequence[LandingSegment], vehicle: Vehicle) -> FlipResidual | None:
    """Compare all flips with commands and at least seven samples; None when there is none."""
    base = below_no_ceiling(vehicle)
    names, errors = [], []
    for landing in landings:
        commands = commanded_thrusts(landing.flight, vehicle)
        if commands is None:
            continue
        times, approach = _compared(landing, *commands), running_until(commands, landing.trigger)
        if times.size < _LEAST_SAMPLES or approach is None:
            continue
        names.append(landing.name)
        thrust = approach[1][-1]
        errors.append([_errors(landing, commands, thrust, base, one, times) for one in VARIANTS.values()])
    if not names:
        return None
    joined = dict(zip(VARIANTS, np.hstack(errors), strict=True))
    mean = {name: float(values.mean()) for name, values in joined.items()}
    rms = {name: float(np.sqrt(np.mean(values**2))) for name, values in joined.items()}
    return FlipResidual(tuple(names), int(joined["as filed"].size), mean, rms, _judge(mean, rms))


def _compared(landing: LandingSegment, command_t: FloatArray, commanded: FloatArray) -> FloatArray:
    """Times of the gyro samples of the flip: until the motors are cut or something touches."""
    cut = command_t[(command_t > landing.trigger + _COMMAND_ROW) & (commanded.max(axis=1) <= 0.0)]
    end = min(landing.before, landing.trigger + LONGEST, cut[0] if cut.size else np.inf)
    t = landing.gyro_t
    return t[(t > landing.trigger) & (t <= end)]


def _errors(
    landing: LandingSegment,
    commands: tuple[FloatArray, FloatArray],
    thrust: FloatArray,
    base: Any,
    variant: Variant,
    times: FloatArray,
) -> FloatArray:
    """Model minus gyro (rad/s) at `times`, from the `thrust` (N, (4,)) that ends the approach."""
    command_t, commanded = commands
    p = base.copy()
    p["time_constant_up"] *= variant.up
    p["time_constant_down"] *= variant.down
    p["inertia"][1] *= variant.pitch_inertia
    steps = int(np.ceil((times[-1] - landing.trigger) / DT)) + 1
    state = new_states(1)
    state["position"][0, 2] = 100.0
    state["thrust"][0] = thrust
    state["omega"][0, 1] = np.interp(landing.trigger, landing.gyro_t, landing.gyro[:, 1])
    trace = np.empty((steps + 1, COLUMNS))
    told = on_steps(command_t + variant.late, commanded, landing.trigger, steps)
    fly(state[0], p, told, 1, trace)
    at = landing.trigger + DT * np.arange(steps + 1)
    model = np.interp(times, at, trace[:, OMEGA + 1])
    return np.asarray(model - np.interp(times, landing.gyro_t, landing.gyro[:, 1]))


def _judge(mean: Mapping[str, float], rms: Mapping[str, float]) -> tuple[str, ...]:
    """Words: what is beyond doubt, and what hides behind the timing."""
    filed = rms["as filed"]
    words = []
    for name, what in (
        ("no motor lag", "the motors' lag"),
        ("spin-down as quick as spin-up", "a spin-down slower than the spin-up"),
    ):
        if rms[name] > 1.5 * filed:
            words.append(f"needs {what}: without it {rms[name]:.1f} instead of {filed:.1f} rad/s RMS")
        else:
            words.append(f"cannot tell {what}: without it {rms[name]:.1f}, with it {filed:.1f} rad/s RMS")
    timing = abs(mean["commands 10 ms later"] - mean["as filed"])
    inertia = 0.5 * abs(mean["pitch inertia 10 % larger"] - mean["pitch inertia 10 % smaller"])
    lag = abs(mean["spin-down 7 % slower"] - mean["as filed"])
    words.append(
        f"10 ms of timing shift the mean by {timing:.1f} rad/s, 10 % of pitch inertia by {inertia:.1f}, 7 % "
        f"of spin-down by {lag:.1f}: a mean of {mean['as filed']:+.1f} rad/s is any of them, and these flips "
        "cannot say which"
    )
    return tuple(words)
