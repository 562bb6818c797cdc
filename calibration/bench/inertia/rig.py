"""The rig: what hangs, on which strings, how well each length and mass is known, and doubts about units."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.inertia.errors import RigError
from calibration.measurement import Estimate, Finding, Severity

LOCAL_GRAVITY = Estimate(9.803, "m/s2", 0.01)
"""Where the place is not known: 9.780 at the equator to 9.832 at the poles."""

_SEPARATION_LIMIT = 0.5  # m
_LENGTH_LIMIT = 5.0  # m
_MASS_LIMITS = (0.005, 2.0)  # kg
_SCALES = (1e-3, 1e-2, 1e-1)  # of a unit mistaken for the SI one: mm or g, cm


def measured(readings: Sequence[float], half_width: float, unit: str) -> Estimate:
    """The mean of repeated readings (GUM 4.2, 4.3.7).

    Args:
        readings: in `unit`; one is allowed, then only the instrument is uncertain.
        half_width: in `unit`, by how much the instrument may be off ("+-0.1 mm").
        unit: "m" or "kg".

    Raises:
        RigError: no reading, one that is not finite, or a negative half width.
    """
    values = np.asarray(readings, dtype=np.float64)
    if not values.size or not np.isfinite(values).all() or not half_width >= 0.0:
        raise RigError(f"readings {list(readings)} +- {half_width} {unit} are no measurement; measure again")
    n = len(values)
    mean_variance = float(np.var(values, ddof=1)) / n if n > 1 else 0.0
    variance = mean_variance + half_width**2 / 3.0
    dof = (n - 1) * (variance / mean_variance) ** 2 if mean_variance > 0.0 else math.inf
    return Estimate(float(np.mean(values)), unit, math.sqrt(variance), dof, half_width)


@dataclass(frozen=True, slots=True)
class Jig:
    """What holds the drone on the strings.

    Attributes:
        mass: kg.
        inertia: kg m2, about the vertical axis through its own centre of mass.
        offset: m, horizontal, between the centres of mass of jig and drone.
    """

    mass: Estimate
    inertia: Estimate
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Rig:
    """Everything of a hang that is not the swing.

    Attributes:
        mass: kg, all that hangs: drone, battery and jig.
        top: m, distance of the strings at the top. bottom: m, at the drone.
        length: m, of the strings, measured with the drone hanging.
        jig: to be subtracted, or None when the strings hold the drone itself.
        gravity: m/s2.
        offset_sigma: m, standard deviation of the centre of mass off the middle, in the plane of the strings.
        tilt_sigma: rad, standard deviation of the body axis off the vertical.
        air: share of the inertia that moving air may add at most (estimate of the bench notes).
        string: standard uncertainty, share of the inertia, from the stiffness of thin braided line.
        mass_after: kg, weighed again after the swings, or None.
    """

    mass: Estimate
    top: Estimate
    bottom: Estimate
    length: Estimate
    jig: Jig | None = None
    gravity: Estimate = LOCAL_GRAVITY
    offset_sigma: float = 0.5e-3
    tilt_sigma: float = math.radians(1.0)
    air: float = 0.002
    string: float = 0.0003
    mass_after: Estimate | None = None

    @property
    def drop(self) -> float:
        """m, height of the hang. RigError where the strings are too short to reach."""
        half = 0.5 * (self.top.value - self.bottom.value)
        if not self.length.value > abs(half):
            raise RigError(
                f"strings of {self.length.value:g} m do not reach from {self.top.value:g} to "
                f"{self.bottom.value:g} m apart; measure again"
            )
        return math.sqrt(self.length.value**2 - half**2)

    @property
    def drone_mass(self) -> float:
        """kg, without the jig."""
        return self.mass.value - (self.jig.mass.value if self.jig else 0.0)


@dataclass(frozen=True, slots=True)
class UnitDoubt:
    """A value that looks as if typed in another unit.

    Attributes:
        name: in the operator's words. value: as typed. unit: it was taken for.
        suggested: what it would be if typed in a smaller unit, or None where no unit makes sense of it.
    """

    name: str
    value: float
    unit: str
    suggested: float | None

    @property
    def question(self) -> str:
        """To be asked, never answered by the program."""
        if self.suggested is None:
            return f"{self.name}: {self.value:g} {self.unit} cannot be; measure and type it again"
        return f"{self.name}: is it really {self.value:g} {self.unit}, or {self.suggested:g} {self.unit}?"


def unit_doubts(mass: float, top: float, bottom: float, length: float) -> list[UnitDoubt]:
    """Values (kg, m) outside what a small drone hangs on, each with the question to ask."""
    checks = (
        ("mass", mass, "kg", _MASS_LIMITS),
        ("string distance at the top", top, "m", (2e-3, _SEPARATION_LIMIT)),
        ("string distance at the drone", bottom, "m", (2e-3, _SEPARATION_LIMIT)),
        ("string length", length, "m", (0.05, _LENGTH_LIMIT)),
    )
    doubts = [
        UnitDoubt(name, value, unit, _in_range(value, limits))
        for name, value, unit, limits in checks
        if not limits[0] <= value <= limits[1]
    ]
    if not doubts and max(top, bottom) > length:
        doubts.append(UnitDoubt("string distance, longer than the strings", max(top, bottom), "m", None))
    return doubts


def _in_range(value: float, limits: tuple[float, float]) -> float | None:
    for scale in (*_SCALES, *(1.0 / scale for scale in _SCALES)):
        if limits[0] <= scale * value <= limits[1]:
            return scale * value
    return None


def check_rig(rig: Rig) -> list[Finding]:
    """Doubts about units, and mass that changed between weighing and swinging."""
    doubts = unit_doubts(rig.mass.value, rig.top.value, rig.bottom.value, rig.length.value)
    findings = [Finding("unit", Severity.REJECT, doubt.question) for doubt in doubts]
    if rig.mass_after is not None:
        change = rig.mass_after.value - rig.mass.value
        limit = max(2.0 * math.hypot(rig.mass.sigma, rig.mass_after.sigma), 1e-4)
        if abs(change) > limit:
            findings.append(
                Finding(
                    "mass_changed",
                    Severity.REJECT,
                    f"the mass changed by {1e3 * change:+.2f} g between weighing and the swings (limit "
                    f"{1e3 * limit:.2f}): another battery? Weigh what hung, or swing again",
                )
            )
    if rig.jig is not None and rig.jig.mass.value >= rig.mass.value:
        text = (
            f"the jig ({1e3 * rig.jig.mass.value:g} g) weighs no less than everything together; weigh again"
        )
        findings.append(Finding("unit", Severity.REJECT, text))
    return findings
