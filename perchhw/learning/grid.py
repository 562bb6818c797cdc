"""Grids of approach conditions, and how work on them is spread over threads."""

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import NamedTuple, TypeVar

import numpy as np

from perchhw.learning.errors import LearningInputError

Task = TypeVar("Task")
Result = TypeVar("Result")


class Condition(NamedTuple):
    """One approach: commanded speed (m/s) and angle above the horizon (deg)."""

    speed: float
    angle_deg: float


def parse_range(text: str, option: str) -> tuple[float, ...]:
    """The values of ``FIRST:LAST:STEP`` (last included), ``A,B,C`` or ``A``.

    Raises:
        LearningInputError: the text is none of these, or means no value.
    """
    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            if not (step > 0.0 and math.isfinite(first) and last >= first):
                raise ValueError
            count = math.floor((last - first) / step + 1e-9) + 1
            return tuple(round(first + k * step, 9) for k in range(count))
        values = tuple(float(part) for part in text.split(","))
    except (ValueError, OverflowError) as error:
        raise LearningInputError(
            f"{option} {text!r} is not a range: write FIRST:LAST:STEP with FIRST <= LAST, or values as A,B,C"
        ) from error
    return values


def conditions(speeds: Iterable[float], angles: Iterable[float]) -> tuple[Condition, ...]:
    """All pairs of speed (m/s) and angle (deg), in this order.

    Raises:
        LearningInputError: a speed or angle that no approach can have, or none at all.
    """
    grid = tuple(Condition(speed, angle) for angle in angles for speed in speeds)
    for speed, angle in grid:
        if not 0.0 < speed <= 10.0:
            raise LearningInputError(f"a speed of {speed:g} m/s makes no approach: give 0 < speed <= 10")
        if not 5.0 <= angle <= 90.0:
            raise LearningInputError(f"an angle of {angle:g} deg makes no approach: give 5 <= angle <= 90")
    if not grid:
        raise LearningInputError("the grid has no condition: give at least one speed and one angle")
    return grid


def generator(seed: int, purpose: int, condition: Condition, repeat: int = 0) -> np.random.Generator:
    """The generator of one task.

    It depends on the seed, the purpose and the condition alone: not on the grid, the order of work or the
    number of workers.
    """
    key = (purpose, round(condition.speed * 1e6), round(condition.angle_deg * 1e6), repeat)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))


def spread(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int
) -> Iterator[tuple[Task, Result]]:
    """Do the tasks on `workers` threads and give each result as it comes.

    The kernels release the interpreter lock. When the caller stops (an error, Ctrl-C), tasks that have not
    begun are dropped and those under way are waited for.
    """
    queue = iter(tasks)
    running: dict[Future[Result], Task] = {}
    with ThreadPoolExecutor(max_workers=workers, thread_name_prefix="rollouts") as pool:
        while True:
            while len(running) < 2 * workers and (task := next(queue, None)) is not None:
                running[pool.submit(work, task)] = task
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield running.pop(future), future.result()
