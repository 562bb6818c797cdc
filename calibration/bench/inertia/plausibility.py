"""Checks of what several trials, and several axes, say together."""

import math
from collections.abc import Sequence

from calibration.bench.inertia.swing_fit import SwingFit
from calibration.measurement import Finding, Severity

SPREAD_WARN = 0.003
GYRATION = (0.012, 0.060)  # m, of a small drone
PRESET_RATIO = 2.0


def check_trials(fits: Sequence[SwingFit], spread: float, fewest: int) -> list[Finding]:
    """Number of trials, their spread (relative), and whether rejected ones count."""
    findings = []
    if len(fits) < fewest:
        text = f"{len(fits)} trial(s), {fewest} needed for a 95 % interval: none is claimed; record more"
        findings.append(Finding("few_trials", Severity.WARNING, text))
    if spread > SPREAD_WARN:
        text = (
            f"the trials' periods differ by {spread:.2%} (standard deviation, limit {SPREAD_WARN:.1%}): "
            "look for loose strings or a draught, and hang the drone again"
        )
        findings.append(Finding("spread", Severity.WARNING, text))
    overridden = [fit.source for fit in fits if fit.rejected]
    if overridden:
        text = f"rejected trials count because the operator said so: {', '.join(overridden)}"
        findings.append(Finding("rejected_counts", Severity.WARNING, text))
    return findings


def check_inertia(inertia: float, mass: float, expected: float | None) -> list[Finding]:
    """Radius of gyration for `mass` (kg), and the ratio to what was `expected` (kg m2)."""
    findings = []
    gyration = math.sqrt(inertia / mass)
    if not GYRATION[0] <= gyration <= GYRATION[1]:
        text = (
            f"{inertia:.3g} kg m2 of {1e3 * mass:.1f} g is a radius of gyration of {1e3 * gyration:.1f} mm "
            f"({1e3 * GYRATION[0]:.0f} to {1e3 * GYRATION[1]:.0f} is usual): check lengths, mass and units"
        )
        findings.append(Finding("gyration", Severity.WARNING, text))
    if expected is not None and not 1.0 / PRESET_RATIO <= inertia / expected <= PRESET_RATIO:
        text = (
            f"{inertia:.3g} kg m2 is {inertia / expected:.2f} of the expected {expected:.3g} "
            f"(limit a factor of {PRESET_RATIO:g}): right axis, right preset, right units?"
        )
        findings.append(Finding("preset", Severity.WARNING, text))
    return findings
