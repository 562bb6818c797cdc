"""The tables of scores on the page of landings: of the vehicle as filed, and of each model of a search."""

from html import escape

from calibration.gap.landings.outcomes.body_contact import ContactScore
from calibration.gap.landings.outcomes.nested import NestedScore
from calibration.gap.landings.outcomes.scores import Count, Score
from calibration.gap.landings.outcomes.search import OutcomeSearch
from calibration.gap.landings.outcomes.words import between, difference, percent
from calibration.gap.report.landing_style import CLASS_WORDS
from calibration.report_style import table


def score_tables(found: Score, contact: ContactScore | None) -> str:
    """Scores beside the base rate's, and how often each end happened beside how often it was expected."""
    rows, counts = _outcome_rows(found), _counts(found)
    if contact is not None:
        rows += _contact_rows(contact)
        counts.append(_count(f"body contact, of {contact.flights} that held", contact.count))
    scores = table(["", "simulation (95 %, flights drawn again)", "base rate of the other flights"], rows)
    return scores + table(["outcome", "real", "expected", "80 % of the time it would be"], counts)


def _outcome_rows(found: Score) -> list[list[str]]:
    auc = "none or all" if found.auc_four is None else f"{found.auc_four:.2f}{between(found.auc_four_ci95)}"
    known = found.brier_gain is not None
    base = f"{found.brier_base_rate:.2f}; knowing this flight too: {found.brier_base_rate_in_sample:.2f}"
    log_score = f"{found.log_score:.2f}{between(found.log_score_ci95)}"
    right = found.brier_if_right
    as_bad = f"{right.mean:.2f}{between(right.ci95)}, as bad as here in {percent(right.p_value)}"
    return [
        [
            "Brier score (0 perfect, 2 worst)",
            f"<b>{found.brier:.2f}</b>{between(found.brier_ci95)}",
            base if known else "",
        ],
        ["its difference to the base rate", difference(found.brier_gain, found.brier_gain_ci95), ""],
        ["what probabilities that are right would score", as_bad, ""],
        ["log score (nats)", log_score, f"{found.log_score_base_rate:.2f}" if known else ""],
        ["AUC of four legs", auc, "0.50"],
    ]


def _contact_rows(found: ContactScore) -> list[list[str]]:
    brier = f"{found.brier:.2f}, difference {difference(found.brier_gain, found.brier_gain_ci95)}"
    log_score = f"{found.log_score:.2f}{between(found.log_score_ci95)}"
    auc = "none or all" if found.auc is None else f"{found.auc:.2f}{between(found.auc_ci95)}"
    bases = (found.brier_base_rate, found.log_score_base_rate)
    base, log_base = ("" if found.brier_gain is None else f"{one:.2f}" for one in bases)
    return [
        ["body contact: Brier score (0 perfect, 1 worst)", brier, base],
        ["body contact: log score (nats)", log_score, log_base],
        ["AUC of body contact", auc, "0.50"],
    ]


def _counts(found: Score) -> list[list[str]]:
    return [
        _count(word, count) for word, count in zip(CLASS_WORDS.values(), found.counts.values(), strict=True)
    ]


def _count(word: str, count: Count) -> list[str]:
    low, high = count.interval80
    outside = "" if count.inside else ": <b>outside</b>"
    return [word, str(count.real), f"{count.expected:.1f}", f"{low} to {high}{outside}"]


def search_table(found: OutcomeSearch, nested: NestedScore | None) -> str:
    """What each model of a search scores, and last the search itself."""
    rows = []
    for fit in found.fits:
        left_out, half = fit.left_one_out, fit.halves
        values = ", ".join(
            f"{name} {one.mean:.3g} &plusmn; {one.sigma:.2g}{' (at bound)' if one.at_bound else ''}"
            for name, one in fit.values.items()
        )
        auc = "" if left_out.auc_four is None else f"{left_out.auc_four:.2f}{between(left_out.auc_four_ci95)}"
        briers = (left_out.brier, left_out.brier_base_rate, half.brier, half.brier_base_rate)
        rows.append([fit.name, *(f"{value:.2f}" for value in briers), auc, values])
    if nested is not None:
        rows.append(_nested_row(nested))
    header = ["open", "Brier, left one out", "base rate", "from halves", "base rate", "AUC of four", "values"]
    return table(header, rows)


def _nested_row(found: NestedScore) -> list[str]:
    one, half = found.left_one_out, found.halves
    auc = "" if one.auc_four is None else f"{one.auc_four:.2f}{between(one.auc_four_ci95)}"
    briers = (one.brier, one.brier_base_rate, half.brier, half.brier_base_rate)
    chosen = ", ".join(f"{escape(name)} {times} times" for name, times in found.chosen.items())
    return [
        "<b>chosen anew without the flights that are predicted</b>",
        *(f"{value:.2f}" for value in briers),
        auc,
        chosen,
    ]
