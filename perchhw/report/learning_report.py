"""``report.html`` of a learning folder: rates, trigger region, moments, convergence, facts."""

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

from calibration.flights import Flight, PoseSource
from calibration.report_style import grid, page, report_style, section, svg, table
from onboard.policy.files import Policy, policy_crc32
from perchhw.learning.bands import band_table
from perchhw.learning.example_data import Convergence, Examples
from perchhw.learning.judged_range import judged_range_in_words
from perchhw.learning.results import LearningResults, RateMap, cues_in_words
from perchhw.report import cue_space, learning_figures
from perchhw.report.approach import approach_views
from perchhw.report.picture import Picture, save_pictures
from perchhw.report.rate_maps import GOOD_RATE, rate_maps
from perchhw.report.run_report import REPORT_FILE


def write_learning_report(
    results: LearningResults, reference: RateMap | None, examples: Examples, pictures: Path | None = None
) -> Path:
    """Write ``report.html`` into the folder; one file that loads nothing from elsewhere.

    Args:
        results: the folder.
        reference: landing rates to compare with.
        examples: one trial and one approach.
        pictures: folder for the figures as PNG files; None for none.
    """
    path = results.folder / REPORT_FILE
    with report_style():
        drawn = list(_pictures(results, reference, examples))
        save_pictures(drawn, pictures)
        path.write_text(_page(results, reference, examples, drawn), encoding="utf-8")
    return path


def _page(
    results: LearningResults, reference: RateMap | None, examples: Examples, drawn: list[Picture]
) -> str:
    settings = results.settings
    legs = f", {settings['legs']} legs" if settings.get("legs") else ""
    doubts = [*results.doubts, *examples.doubts]
    body = ""
    if doubts:
        body += section("Read with care", "<br>".join(escape(doubt) for doubt in doubts))
    first, *others = drawn
    body += _expected(results)
    body += section(first.title, svg(first.figure, first.title), first.meaning)
    body += section(
        "Landing rate by band",
        _bands(results, reference),
        "Mean over the conditions of a band of the rate of four-leg landings without contact of body or "
        "propellers. For pairs it is the best of a condition's trials.",
    )
    for picture in others:
        body += section(picture.title, svg(picture.figure, picture.title), picture.meaning)
    body += grid([section(title, table(["", ""], rows)) for title, rows in _facts(results) if rows])
    title = f"Learning to land: {settings.get('vehicle')}{legs}"
    return page(title, str(results.folder.resolve().name), body)


def _pictures(results: LearningResults, reference: RateMap | None, examples: Examples) -> Iterator[Picture]:
    """All figures that there is content for."""
    maps = _maps(results, reference)
    yield Picture(
        "landing_rates", "Landing rate over speed and approach angle", _maps_meaning(maps), rate_maps(maps)
    )
    if results.pairs:
        yield from _pair_pictures(results, examples.flight)
    if examples.flight is not None:
        yield Picture(
            "approach",
            f"One approach: {examples.flight.name}",
            _flight_meaning(examples.flight),
            approach_views(examples.flight),
        )
    if examples.trial is not None:
        yield Picture(
            "convergence",
            f"One learning trial: {examples.trial.condition.speed:g} m/s at "
            f"{examples.trial.condition.angle_deg:g} deg",
            _trial_meaning(examples.trial),
            learning_figures.convergence(examples.trial),
        )


def _pair_pictures(results: LearningResults, flight: Flight | None) -> Iterator[Picture]:
    """The pairs, and what the policy made of them."""
    yield Picture(
        "pairs",
        "Sensory-motor pairs",
        "Each dot is one learning trial: the state in which it learned to flip, coloured by how often it "
        "then landed. Where bright and dark dots lie apart, the three cues are enough to know when to flip.",
        cue_space.pairs_in_space(results.pairs),
    )
    if results.policy is not None:
        yield from _policy_pictures(results, results.policy, flight)
    yield Picture(
        "moment",
        "Flip moment against time to contact",
        _moment_meaning(results),
        learning_figures.moment_against_tau(results.pairs, results.policy, results.validation),
    )


def _maps(results: LearningResults, reference: RateMap | None) -> list[RateMap]:
    """What real flights are like first, then kinder worlds, then what the policy learned from."""
    maps = (results.measured_rates(), results.policy_rates(), results.pair_rates(), reference)
    return [one for one in maps if one is not None]


def _expected(results: LearningResults) -> str:
    """The rates that a lab should count on, before any kinder ones."""
    summary = results.validation_summary or {}
    measured, expected = summary.get("measured"), summary.get("real_rate")
    if measured is None:
        return ""
    worlds = [("simulated, as real approaches scatter", measured)]
    if not results.measured_alone:
        worlds.append((f"simulated, {cues_in_words(summary['settings'])}", summary))
    rows = [
        [
            name,
            f"{world['four_leg_rate']:.2f}",
            f"{world['two_leg_rate']:.2f}",
            f"{world['trigger_rate']:.2f}",
        ]
        for name, world in worlds
    ]
    words = (
        "No real flights tell what this vehicle does of that: perchhw gap landings --out, then "
        "perchhw learn validate --landings."
    )
    if expected is not None:
        (low, high), (least, most) = expected["ci95"], expected["four_leg_count80"]
        rows.insert(
            0,
            [
                "<b>to be expected in reality</b>",
                f"<b>{expected['four_leg_rate']:.2f}</b> ({low:.2f} to {high:.2f})",
                "",
                "",
            ],
        )
        words = (
            f"Of {expected['next_flights']} flights over all conditions {least} to {most} will hold on four "
            "legs (80 %): the simulated rate as real approaches scatter, with the error that the simulation "
            "showed on flights of known outcome."
        )
        if (inside := summary.get("inside_judged_range")) is not None:
            words += f" {judged_range_in_words(inside)}"
    return section("What to expect", table(["", "any four legs", "two legs", "triggers"], rows), words)


def _maps_meaning(maps: list[RateMap]) -> str:
    text = (
        "Across is the horizontal speed, up is the climb. Dots have the measured rate of their condition, "
        f"the surface is smoothed, and the black line is a rate of {GOOD_RATE:g}: brighter is better."
    )
    if maps[-1].name.startswith("reference"):
        text += " A reference counts landings by its own rule."
    if any(m.trigger_rates is not None and min(m.trigger_rates.values()) < 0.5 for m in maps):
        text += (
            " On the dark side of the orange dashes the policy triggers in fewer than half of the attempts."
        )
    return text


def _policy_pictures(results: LearningResults, policy: Policy, flight: Flight | None) -> Iterator[Picture]:
    approach = ""
    if flight is not None:
        fired = "flips where the circle is" if flight.trigger is not None else "does not flip"
        approach = f" The red line is an approach ({flight.name}); it {fired}."
    yield Picture(
        "trigger_region",
        "Trigger region in optical-flow space",
        f"The policy flips as soon as the cues enter the shaded body, seen from two sides.{approach}",
        cue_space.region_with_approach(results.pairs, policy, flight),
    )
    yield Picture(
        "trigger_slices",
        "Cuts through the trigger region",
        "The same body cut at four distances to the ceiling, with the pairs near each cut; an approach comes "
        "from the left. The body should hold the bright dots and leave out the dark ones.",
        cue_space.region_slices(results.pairs, policy, flight),
    )


def _moment_meaning(results: LearningResults) -> str:
    text = "Each dot is a pair (left) or the policy at one condition (right); stronger flips are higher."
    correlation = learning_figures.moment_correlation(results.pairs)
    if correlation is not None:
        trend = "stronger" if correlation < 0.0 else "weaker"
        text += (
            f" Over the pairs of {GOOD_RATE:g} or more, a later flip (smaller tau) is a {trend} one: the "
            f"correlation of |a_rot| with tau is {correlation:.2f}."
        )
    return text


def _flight_meaning(flight: Flight) -> str:
    text = (
        "The body is a stroke with a dot at the nose. Time to contact falls while the trigger value rises; "
    )
    if flight.trigger is None:
        text += "here it stays below zero where the policy looks, so the drone never flips."
    else:
        text += "at zero the drone flips."
    if flight.pose_source is PoseSource.TRUTH:
        text += (
            " The cues drawn are the true ones; the policy sees them as old and as wrong as the sensing says."
        )
    return text


def _trial_meaning(trial: Convergence) -> str:
    episodes = len(trial.rewards)
    narrow = f"became narrow enough to stop after {episodes}" if trial.converged else f"used all {episodes}"
    text = (
        "The distribution that the samples come from moves towards the best of each episode. In trial "
        f"{trial.repeat} it {narrow} episodes, and then {trial.landing_rate:.0%} of the attempts landed."
    )
    if not trial.as_recorded:
        text += " The sweep has no such trial, or the code has changed since: its own came out differently."
    return text


def _bands(results: LearningResults, reference: RateMap | None) -> str:
    """Rates by band of every map, in one table."""
    maps = _maps(results, reference)
    tables = [{(b["angles"], b["speeds"]): b for b in band_table(dict(m.rates))} for m in maps]
    triggers = maps[0].trigger_rates
    fired = {} if triggers is None else {(b["angles"], b["speeds"]): b for b in band_table(dict(triggers))}
    header = ["approach angle", "speed", "conditions", *(m.name for m in maps)]
    rows = []
    for key, band in tables[0].items():
        rates = [f"{t[key]['rate']:.2f}" if key in t else "" for t in tables]
        more = [f"{fired[key]['rate']:.2f}"] if key in fired else []
        rows.append([escape(key[0]), escape(key[1]), str(band["conditions"]), *rates, *more])
    return table([*header, *(["policy triggers"] if fired else [])], rows)


def _facts(results: LearningResults) -> Iterator[tuple[str, list[list[str]]]]:
    """Tables of settings, counts, policy and speed."""
    settings, counts = results.settings, results.sweep.get("result", {})
    names = (
        "vehicle",
        "legs",
        "leg_angle_deg",
        "leg_length_m",
        "reward",
        "domain",
        "sensing",
        "gains",
        "ceiling_z",
        "seed",
    )
    rows = [
        [name.replace("_", " "), escape(str(settings[name]))]
        for name in names
        if settings.get(name) is not None
    ]
    for name, unit in (("speeds", "m/s"), ("angles_deg", "deg")):
        values = settings.get(name) or []
        if values:
            rows.append(
                [name.removesuffix("_deg"), f"{values[0]:g} to {values[-1]:g} {unit}, {len(values)} values"]
            )
    if "repeats" in settings:
        rows.append(["repeats", str(settings["repeats"])])
    rows += [
        [escape(name), escape(str(number))] for name, number in results.sweep.get("versions", {}).items()
    ]
    yield "Settings", rows
    yield "Sweep", _sweep_facts(results, counts) if results.pairs else []
    yield "Policy and validation", _policy_facts(results)


def _sweep_facts(results: LearningResults, counts: dict[str, Any]) -> list[list[str]]:
    trials = len(results.pairs)
    good = sum(float(row["landing_rate"] or 0.0) >= GOOD_RATE for row in results.pairs)
    converged = sum(bool(row["converged"]) for row in results.pairs)
    rollouts = sum(int(row["rollouts"] or 0) for row in results.pairs)
    rows = [
        ["trials", f"{trials:,}"],
        ["attempts", f"{rollouts:,}"],
        ["attempts a trial", f"{rollouts / trials:.1f}"],
        [f"pairs of {GOOD_RATE:g} or more", f"{good:,} ({good / trials:.0%})"],
        ["trials that converged", f"{converged:,} ({converged / trials:.0%})"],
        [
            "attempts with a number that is not finite",
            f"{sum(int(r['not_finite'] or 0) for r in results.pairs):,}",
        ],
    ]
    if "seconds" in counts:
        rows += [
            ["time of the last run", f"{counts['seconds']:.1f} s"],
            ["attempts a second", f"{counts['rollouts_per_second']:,.0f}"],
            ["steps of physics a second", f"{counts['steps_per_second']:.3g}"],
        ]
    return rows


def _policy_facts(results: LearningResults) -> list[list[str]]:
    policy, training, summary = results.policy, results.training, results.validation_summary
    rows: list[list[str]] = []
    if policy is not None:
        rows += [
            ["policy", f"{escape(policy.name)}, crc32 0x{policy_crc32(policy):08x}"],
            ["support vectors", str(len(policy.dual_coefficients))],
            ["network", "-".join(str(size) for size in policy.layer_sizes)],
            ["triggers at tau", f"{policy.tau_min:.3f} to {policy.tau_max:.3f} s"],
        ]
    if training is not None:
        if "attempts" in training:
            rows.append(["attempts at random", f"{training['attempts']:,}"])
        rows += [
            ["pairs trained on", str(training["pairs"])],
            ["of them inside the region", f"{training['inside_share']:.0%}"],
            ["error of the moment (RMS)", f"{1e3 * training['action_rms_nm']:.2f} N mm"],
            ["on pairs held out", f"{1e3 * training['action_held_out_rms_nm']:.2f} N mm"],
        ]
    if summary is not None:
        rows += [
            ["attempts at each condition", str(summary["rollouts_per_condition"])],
            ["sensing in the validation", escape(str(summary.get("settings", {}).get("sensing")))],
            ["attempts that triggered", f"{summary['trigger_rate']:.0%}"],
        ]
    return rows
