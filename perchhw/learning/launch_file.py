"""How a lab's own approaches and flips scatter, from ``landings.json`` of `perchhw gap landings --out`."""

from pathlib import Path
from typing import Any

from calibration.gap.landings.outcomes.document import SCHEMA
from onboard.json_file import parsed
from onboard.schema import schema_problem
from perchhw.learning.errors import LearningInputError
from sim_backend.physics.launch import Launch

_OF_DISPERSION = {"flip_spread": "pitch", "flip_roll": "roll"}


def read_landings(path: Path) -> dict[str, Any]:
    """The document.

    Raises:
        LearningInputError: it cannot be read, or is of another version.
    """
    try:
        found = parsed(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(
            f"{path}: cannot be read ({error}): give the landings.json of perchhw gap landings --out"
        ) from error
    problem = schema_problem(found.get("schema") if isinstance(found, dict) else None, SCHEMA)
    if problem is not None:
        raise LearningInputError(
            f"{path}: schema {problem}; give the landings.json of perchhw gap landings --out"
        )
    return dict(found)


def launch_of(path: Path) -> tuple[float, ...]:
    """Values of :class:`sim_backend.physics.launch.Launch` as the flights of the document show them.

    Raises:
        LearningInputError: it cannot be read, too few of its flights were told a speed and an angle, or no
            session tells its ceiling.
    """
    document = read_landings(path)
    try:
        launch, dispersion = document["launch"], document["dispersion"]
        return tuple(
            float(dispersion[_OF_DISPERSION[name]] if name in _OF_DISPERSION else launch[name])
            for name in Launch._fields
        )
    except (KeyError, TypeError, ValueError) as error:
        raise LearningInputError(
            f"{path}: does not say how approaches scatter (launch): give the landings.json of at least five "
            "flights with a commanded speed and angle, four of one session with a contact"
        ) from error
