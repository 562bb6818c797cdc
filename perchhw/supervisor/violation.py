"""What a broken rule says, and the comparisons that rules are made of: what is unknown breaks them."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that does not hold: its name, what was measured, and what was demanded."""

    rule: str
    measured: str
    demanded: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.measured}, need {self.demanded}"


Rule = Callable[[Admitted, SafetyLimits], Violation | None]


def at_most(rule: str, value: float | None, limit: float, unit: str) -> Violation | None:
    """`value` is known, finite and not above `limit`."""
    if value is None:
        return Violation(rule, "unknown", f"at most {limit:g} {unit}")
    if not (isfinite(value) and value <= limit):  # so that a limit of NaN allows nothing
        return Violation(rule, f"{value:.3g} {unit}", f"at most {limit:g} {unit}")
    return None


def at_least(rule: str, value: float | None, limit: float, unit: str) -> Violation | None:
    """`value` is known, finite and not below `limit`."""
    if value is None:
        return Violation(rule, "unknown", f"at least {limit:g} {unit}")
    if not (isfinite(value) and value >= limit):
        return Violation(rule, f"{value:.3g} {unit}", f"at least {limit:g} {unit}")
    return None


def all_violations(rules: tuple[Rule, ...], o: Admitted, limits: SafetyLimits) -> tuple[Violation, ...]:
    """Those of `rules` that do not hold, in their order; of several with one name the first."""
    found: dict[str, Violation] = {}
    for rule in rules:
        violation = rule(o, limits)
        if violation is not None:
            found.setdefault(violation.rule, violation)
    return tuple(found.values())


def first_violation(rules: tuple[Rule, ...], o: Admitted, limits: SafetyLimits) -> Violation | None:
    """The first of `rules` that does not hold, or ``None`` when all do."""
    for rule in rules:
        violation = rule(o, limits)
        if violation is not None:
            return violation
    return None
