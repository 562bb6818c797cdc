"""What speaks against a capture fit, and what would help."""

from calibration.bench.capture.fit import HIGHEST, CaptureFit
from calibration.bench.check_table import NOTED, REJECTED, Check, above, below, findings_of
from calibration.measurement import Finding


def check_fit(fit: CaptureFit) -> list[Finding]:
    """Findings on drops and fit, the worst of each kind."""
    drops = fit.drops
    stuck, thrown = int(drops.stuck.sum()), int(drops.thrown.sum())
    alike = stuck in (0, thrown)
    slowest, fastest = float(drops.speed.min()), float(drops.speed.max())
    width = fit.speed_interval[1] - fit.speed_interval[0]
    relative = max(fit.speed_interval[1] - fit.speed, fit.speed - fit.speed_interval[0])
    table = (
        Check(
            "all_stuck",
            float(alike and stuck > 0),
            REJECTED,
            f"every drop stuck, down to {slowest:.2f} m/s",
            f"the limit lies below {fit.speed_interval[1]:.2f} m/s (95 %): drop slower",
        ),
        Check(
            "none_stuck",
            float(alike and stuck == 0),
            REJECTED,
            f"no drop stuck, up to {fastest:.2f} m/s",
            f"the limit lies above {fit.speed_interval[0]:.2f} m/s (95 %): drop faster",
        ),
        Check(
            "no_rise",
            float(not alike and not fit.rises),
            REJECTED,
            f"{stuck} of {thrown} stuck, and not clearly more at higher speeds",
            "drop more, slower and faster",
        ),
        Check(
            "open_end",
            float(not alike and fit.rises and fit.speed_interval[1] >= HIGHEST),
            REJECTED,
            "the speed has no upper limit",
            "drop faster",
        ),
        Check(
            "separated",
            float(drops.separated),
            NOTED,
            "every drop that stuck was faster than every one that did not: the speed is the gap's middle, "
            f"the spread anything up to {fit.spread_interval[1]:.2f} m/s and written as 0",
            "drop more within the gap and beside it",
        ),
        Check(
            "few_drops",
            float(thrown),
            below(warning=20.0),
            "{:.0f} drops, wanted are {:.0f}",
            "see which come next",
        ),
        Check(
            "wide",
            relative / max(fit.speed, 1e-9) if fit.rises and not alike else None,
            above(warning=0.3),
            f"the speed is open by {width:.2f} m/s",
            "see which drops come next",
        ),
        Check(
            "misfit",
            fit.misfit,
            below(warning=0.01),
            "drops scatter around the curve as they would by chance with a probability of {:.1g}",
            "does the pad get dirty or tired? Clean it before each drop, and mix the speeds",
        ),
    )
    return findings_of("", table)
