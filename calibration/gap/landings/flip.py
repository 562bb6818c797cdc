"""The flip before the contact: pitch rate predicted from the logged commands, against the gyro.

Free of contact and short, it shows what motors and pitch inertia are worth. Variants of the model say which
of them the logs could tell apart: a difference below that of a few milliseconds of timing they cannot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True)
class Variant:
    """A change of the model.

    Attributes:
        up, down: factors on the motors' time constants. inertia: factor on the pitch inertia.
        late: s by which the commands act later than logged.
    """

    up: float = 1.0
    down: float = 1.0
    inertia: float = 1.0
    late: float = 0.0


VARIANTS: Mapping[str, Variant] = {
    "as filed": Variant(),
    "spin-down 7 % slower": Variant(down=0.16 / 0.15),
    "spin-up 20 %, spin-down 7 % slower": Variant(up=1.2, down=0.16 / 0.15),
    "spin-down as quick as spin-up": Variant(down=1.0 / 3.0),
    "no motor lag": Variant(up=1e-2, down=1e-2),
    "pitch inertia 10 % smaller": Variant(inertia=0.9),
    "pitch inertia 10 % larger": Variant(inertia=1.1),
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
    errors: dict[str, list[FloatArray]] = {name: [] for name in VARIANTS}
    names = []
    for landing in landings:
        commands = commanded_thrusts(landing.flight, vehicle)
        if commands is None:
            continue
        times = _compared(landing, *commands)
        if times.size < _LEAST_SAMPLES:
            continue
        found = {
            name: _errors(landing, commands, _changed(base, variant), variant.late, times)
            for name, variant in VARIANTS.items()
        }
        if not found["as filed"].size:
            continue
        names.append(landing.name)
        for name, own in found.items():
            errors[name].append(own)
    if not names:
        return None
    joined = {name: np.concatenate(values) for name, values in errors.items()}
    mean = {name: float(values.mean()) for name, values in joined.items()}
    rms = {name: float(np.sqrt(np.mean(values**2))) for name, values in joined.items()}
    count = int(joined["as filed"].size)
    return FlipResidual(tuple(names), count, mean, rms, _judge(mean, rms))


def _compared(landing: LandingSegment, command_t: FloatArray, commanded: FloatArray) -> FloatArray:
    """Times of the gyro samples of the flip: until the motors are cut or something touches."""
    cut = command_t[(command_t > landing.trigger + _COMMAND_ROW) & (commanded.max(axis=1) <= 0.0)]
    end = min(landing.before, landing.trigger + LONGEST, cut[0] if cut.size else np.inf)
    t = landing.gyro_t
    return t[(t > landing.trigger) & (t <= end)]


def _changed(base: Any, variant: Variant) -> Any:
    changed = base.copy()
    changed["time_constant_up"] *= variant.up
    changed["time_constant_down"] *= variant.down
    changed["inertia"][1] *= variant.inertia
    return changed


def _errors(
    landing: LandingSegment, commands: tuple[FloatArray, FloatArray], p: Any, late: float, times: FloatArray
) -> FloatArray:
    """Model minus gyro (rad/s) at `times`; none where not all motors ran before the trigger.

    The thrusts start from the last command in which all four motors ran.
    """
    approach = running_until(commands, landing.trigger)
    if approach is None:
        return np.zeros(0)
    command_t, commanded = commands
    steps = int(np.ceil((times[-1] - landing.trigger) / DT)) + 1
    state = new_states(1)
    state["position"][0, 2] = 100.0
    state["thrust"][0] = approach[1][-1]
    state["omega"][0, 1] = np.interp(landing.trigger, landing.gyro_t, landing.gyro[:, 1])
    trace = np.empty((steps + 1, COLUMNS))
    fly(state[0], p, on_steps(command_t + late, commanded, landing.trigger, steps), 1, trace)
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
