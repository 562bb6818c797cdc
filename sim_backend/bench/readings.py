"""What a person reads off an instrument: the truth and an error of the size of the instrument's."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Grade:
    """Half-widths of the (rectangular) errors of one reading.

    Attributes:
        distance: m, between strings.
        length: m, of a string.
        mass: kg.
        voltage: relative, of the multimeter.
    """

    distance: float
    length: float
    mass: float
    voltage: float = 0.001

    def read(self, truth: float, half_width: float, rng: np.random.Generator) -> float:
        """One reading of `truth` with an error up to `half_width`."""
        return truth + half_width * float(rng.uniform(-1.0, 1.0))


JIG = Grade(distance=1e-4, length=5e-4, mass=2e-5)
"""A printed jig, a steel tape, a balance (bench notes 1.1)."""
