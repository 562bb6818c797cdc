"""A table of checks: the worst limit that is crossed decides, what is missing crosses none."""

import math

import pytest

from calibration.bench.check_table import NOTED, REJECTED, Check, Limits, above, below, findings_of
from calibration.measurement import Severity

LOSS, CYCLES = above(reject=0.2, warning=0.05), below(reject=8.0, warning=15.0)


@pytest.mark.parametrize(
    ("limits", "value", "severity", "limit"),
    [
        (LOSS, 0.3, Severity.REJECT, "20%"),
        (LOSS, 0.1, Severity.WARNING, "5%"),
        (CYCLES, 6.0, Severity.REJECT, "800%"),
        (CYCLES, 12.0, Severity.WARNING, "1500%"),
    ],
)
def test_the_worst_limit_decides(limits: Limits, value: float, severity: Severity, limit: str) -> None:
    (finding,) = findings_of("a.csv", [Check("code", value, limits, "{:g} (limit {:.0%})", "do this")])
    assert (finding.code, finding.severity) == ("code", severity)
    assert finding.text == f"a.csv: {value:g} (limit {limit}); do this"


@pytest.mark.parametrize(
    ("limits", "value"),
    [
        (LOSS, 0.05),
        (CYCLES, 15.0),
        (LOSS, None),
        (LOSS, math.nan),
        (CYCLES, math.nan),
        (REJECTED, False),
        (NOTED, 0),
    ],
)
def test_what_is_within_or_missing_is_no_finding(limits: Limits, value: float | None) -> None:
    assert findings_of("a.csv", [Check("code", value, limits, "{:g}", "do this")]) == []
