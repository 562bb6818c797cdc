"""What ``perchhw gap landings`` says on stdout."""

from typing import TYPE_CHECKING

from onboard.json_file import as_json
from perchhw.consoles import console, progress_console, say, table_console

if TYPE_CHECKING:
    from calibration.gap.landings.outcomes import LandingReport
    from calibration.gap.landings.outcomes.body_contact import ContactScore
    from calibration.gap.landings.outcomes.nested import NestedScore
    from calibration.gap.landings.outcomes.scores import Count, Score
    from calibration.gap.landings.outcomes.search import OutcomeSearch


def tell_landings(report: "LandingReport") -> None:
    """Flights, scores, what a search found, and the sentences, on stdout."""
    from rich.markup import escape
    from rich.table import Column, Table

    screen = console()
    name = Column("flight", overflow="fold")  # cut off, many would be the same
    listed = Table(name, "real", "four", "two", "none", "body contact", box=None, pad_edge=False)
    for flight in as_json(report)["flights"]:
        shares = [f"{flight[key]:.2f}" for key in ("p_four", "p_two", "p_none", "p_body_contact")]
        listed.add_row(escape(flight["name"]), flight["real"] or "", *shares)
    table_console().print(listed)
    if report.score is not None:
        _tell_score(report.score)
    if report.contact_score is not None:
        _tell_contact(report.contact_score)
    if report.prepared.roll is not None:
        say(screen, f"roll in the flips, not refuted: {', '.join(report.prepared.roll.left) or 'nothing'}")
    if report.search is not None:
        _tell_search(report.search)
    if report.nested is not None:
        _tell_nested(report.nested)
    for item in report.unused:
        say(progress_console(), f"not judged: {item.name}: {item.reason}")
    for sentence in (*report.words, *report.prospects):
        say(screen, sentence)


def _tell_score(found: "Score") -> None:
    from calibration.gap.landings.outcomes.words import between, difference, percent

    screen, known = console(), found.brier_gain is not None
    base = (
        f", base rate {found.brier_base_rate:.2f} (in sample {found.brier_base_rate_in_sample:.2f}); "
        f"difference {difference(found.brier_gain, found.brier_gain_ci95)}"
    )
    say(screen, f"Brier {found.brier:.2f}{base if known else between(found.brier_ci95)}")
    right = found.brier_if_right
    say(
        screen,
        f"Brier of probabilities that are right {right.mean:.2f}{between(right.ci95)}; as bad as "
        f"{found.brier:.2f} or worse in {percent(right.p_value)}",
    )
    log_base = f", base rate {found.log_score_base_rate:.2f}" if known else ""
    say(screen, f"log score {found.log_score:.2f}{between(found.log_score_ci95)}{log_base}")
    if found.auc_four is not None:
        say(screen, f"AUC of four legs {found.auc_four:.2f}{between(found.auc_four_ci95)}")
    for word, count in found.counts.items():
        say(screen, f"{word}: {_counted(count)}")


def _counted(count: "Count") -> str:
    low, high = count.interval80
    outside = "" if count.inside else "; outside"
    return f"{count.real} real, {count.expected:.1f} expected (80 %: {low} to {high}{outside})"


def _tell_contact(found: "ContactScore") -> None:
    from calibration.gap.landings.outcomes.words import between, difference

    known = found.brier_gain is not None
    base = (
        f", base rate {found.brier_base_rate:.2f}, difference "
        f"{difference(found.brier_gain, found.brier_gain_ci95)}"
    )
    log_base = f", base rate {found.log_score_base_rate:.2f}"
    auc = "" if found.auc is None else f"; AUC {found.auc:.2f}{between(found.auc_ci95)}"
    say(
        console(),
        f"body contact of {found.flights} flights that held: {_counted(found.count)}; Brier "
        f"{found.brier:.2f}{base if known else ''}; log score {found.log_score:.2f}"
        f"{between(found.log_score_ci95)}{log_base if known else ''}{auc}",
    )


def _tell_search(found: "OutcomeSearch") -> None:
    from rich.table import Table

    from calibration.gap.landings.outcomes.words import between

    screen = console()
    columns = ("open", "Brier, left one out", "base", "from the other half", "base", "AUC of four", "values")
    table = Table(*columns, box=None, pad_edge=False)
    for fit in found.fits:
        left_out, half = fit.left_one_out, fit.halves
        values = ", ".join(
            f"{name} {one.mean:.3g} +- {one.sigma:.2g}{' (at bound)' if one.at_bound else ''}"
            for name, one in fit.values.items()
        )
        scores = (
            f"{value:.3f}"
            for value in (left_out.brier, left_out.brier_base_rate, half.brier, half.brier_base_rate)
        )
        table.add_row(
            fit.name,
            *scores,
            "" if left_out.auc_four is None else f"{left_out.auc_four:.2f}{between(left_out.auc_four_ci95)}",
            values,
        )
    table_console().print(table)
    for group, gain in found.gains.items():
        verdict = (
            "wrong"
            if group in found.named
            else "cannot be told"
            if group in found.left_open
            else "another law does better"
        )
        say(
            screen,
            f"{group}: {verdict} (Brier {gain.brier:+.3f}, {gain.ci95[0]:+.3f} to {gain.ci95[1]:+.3f})",
        )


def _tell_nested(found: "NestedScore") -> None:
    """The score to quote: that of the best model is of a model which these flights chose."""
    from calibration.gap.landings.outcomes.words import between, difference

    one, half, best = found.left_one_out, found.halves, found.halves_of_best
    count = sum(found.chosen_by_halves.values())
    auc = "" if one.auc_four is None else f"; AUC of four {one.auc_four:.2f}{between(one.auc_four_ci95)}"
    (model, times), (by_halves, times_by_halves) = (
        next(iter(chosen.items())) for chosen in (found.chosen, found.chosen_by_halves)
    )
    say(
        console(),
        f"with the model chosen anew without each flight (most often {model}, {times} of {one.flights}): "
        f"Brier {one.brier:.3f}, base {one.brier_base_rate:.3f}; difference "
        f"{difference(one.brier_gain, one.brier_gain_ci95)}{auc}",
    )
    say(
        console(),
        f"with the model chosen by the other half (most often {by_halves}, {times_by_halves} of {count}): "
        f"Brier {half.brier:.3f}, base {half.brier_base_rate:.3f}; the best model of all flights on the same "
        f"halves {best.brier:.3f}",
    )
