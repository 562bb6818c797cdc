"""What a set of landings could not show, in words."""

from collections.abc import Iterator, Sequence

import numpy as np

from calibration.gap.landings.problem import HORIZON, Problem
from calibration.gap.landings.search import EXPLAINED, STRONGEST
from onboard.vehicle import Vehicle


def limitations(problems: Sequence[Problem], vehicle: Vehicle, left: float) -> Iterator[str]:
    """Sentences about these landings; `left`: median cost per residual with what was found."""
    if not problems:
        return
    if left > EXPLAINED:
        yield (
            f"the best vehicle still leaves a cost of {left:.1f} per residual, where equations that hold "
            "leave 0.1 to 0.3: values are those of the nearest model, not of the legs alone"
        )
    untracked = sum(not problem.segment.tracked for problem in problems)
    if untracked:
        yield (
            f"{untracked} of {len(problems)} landings have an onboard estimate only: after the flip began "
            "they were judged by their gyro, from a start that is known to about 3 deg and 0.15 m/s"
        )
    unknown = sum(not problem.motors_known for problem in problems)
    if unknown:
        yield f"{unknown} landings lack motor commands; their rotors were taken as still"
    rates = np.concatenate([np.abs(p.seen.gyro[:, 1:]).ravel() for p in problems])
    saturated = float(np.mean(rates > 0.995 * problems[0].seen.limit))
    if saturated > 0.0:
        yield f"{saturated:.1%} of the gyro samples are at its range and count only as that"
    interval = float(np.median([np.median(np.diff(p.seen.gyro[:, 0])) for p in problems]))
    if interval > 0.012:
        yield (
            f"the gyro was logged every {interval * 1e3:.0f} ms: shocks of a few milliseconds fall between, "
            "and the peak pull on a foot is not seen"
        )
    body = vehicle.body.inertia_yy
    if body.sigma > 0.0:
        yield (
            "a period shows stiffness over inertia: the pitch inertia of the vehicle file is known within "
            f"{body.sigma / body.value:.0%}, and so is any stiffness found here"
        )
    yield (
        f"a foot that holds more than {np.exp(STRONGEST):.0f} N, or needs a push far below the first shock, "
        f"looks like a perfect one; feet that come off later than {HORIZON:.1f} s after the contact go unseen"
    )
