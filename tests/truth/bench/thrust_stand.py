"""A simulated scale, supply and motors: raw tables with drift and noise, from published curves."""

import numpy as np

from calibration.bench.thrust.pwm import applied_duty, exact_set_points
from calibration.bench.thrust.raw_table import RawTable
from calibration.bench.thrust.units import Units

GF = 9.80665e-3
CUBICS = {
    "L250": (-0.014830744918356092, 0.04724465241828281, -0.01847364358025878, 0.005960923942142),
    "T350": (0.006728127583707208, 0.01011557616217668, 0.010263198062061085, 0.0028358638322392503),
    "P250": (-0.02476537915958403, 0.06523793527519485, -0.026792504967750107, 0.006776789303971145),
}


def truth(name: str, voltage: np.ndarray) -> np.ndarray:
    """N of one motor."""
    if name == "DC":  # V = v0 + a1 sqrt(f) + a2 f, f in gf
        v0, a1, a2 = 0.05, 0.42, 0.115
        root = (np.sqrt(a1**2 + 4.0 * a2 * np.maximum(voltage - v0, 0.0)) - a1) / (2.0 * a2)
        return root**2 * GF
    return np.maximum(np.polynomial.polynomial.polyval(voltage, CUBICS[name]), 0.0)


def record(
    name: str,
    rng: np.random.Generator,
    points: int = 25,
    noise_g: float = 0.05,
    drift_g: float = 0.2,
    supplies: tuple[float, ...] = (4.0,),
    motors: int = 1,
    lowest: float = 0.3,
    highest_v: float = 3.0,
    noise_v: float = 5e-3,
) -> RawTable:
    """A run in random order; tares before, in the middle of and after each block; the zero drifts."""
    rows: list[tuple[float, float, str, float, float]] = []
    t = 0.0
    for block, supply in enumerate(supplies):
        commands = rng.permutation(exact_set_points(points, lowest, min(highest_v / supply, 1.0)))
        middle = len(commands) // 2
        order = [0, *commands[:middle], 0, *commands[middle:], 0]
        for command in order:
            rows.append((t, float(block), "point" if command else "tare", float(command), supply))
            t += 2.5
    time, block_of, kinds, command, volts = (list(column) for column in zip(*rows, strict=True))
    times, commands16, supply_v = np.array(time), np.array(command), np.array(volts)
    thrust = np.where(commands16 > 0.0, truth(name, applied_duty(commands16) * supply_v) * motors, 0.0)
    path = np.interp(
        times, [0.0, 0.5 * times[-1], times[-1]], np.array([0.0, rng.uniform(-1, 1), rng.uniform(-1, 1)])
    )
    drift = drift_g * path / max(float(np.ptp(path)), 1e-9)
    scale = thrust / GF + drift + rng.normal(0.0, noise_g, times.size)
    return RawTable(
        name="run.csv",
        units=Units(),
        time=times,
        block=np.array(block_of),
        kind=tuple(kinds),
        command=commands16,
        supply=supply_v.copy(),
        board=supply_v + rng.normal(0.0, noise_v, times.size),
        scale=scale * GF,
        motors=np.full(times.size, float(motors)),
    )
