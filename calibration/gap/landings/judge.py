"""Judge a set of landings: which effect of legs and feet is missing in a vehicle file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.flights import Flight
from calibration.gap.data.found_effect import FoundEffect, FoundParameter, Improvement, Verdict, separations
from calibration.gap.data.record import NotUsed
from calibration.gap.landings.choose import REPLICATES, Choice, at_bound, choose, intervals
from calibration.gap.landings.findings import LandingFindings
from calibration.gap.landings.flip import flip_residual
from calibration.gap.landings.kernels import BODY
from calibration.gap.landings.limitations import limitations
from calibration.gap.landings.problem import (
    EARLY,
    HORIZON,
    Problem,
    Solver,
    landing_trace,
    pose_problems,
    rate_error,
    shortened,
)
from calibration.gap.landings.search import (
    MODELS,
    NOMINAL,
    PERFECT,
    ScoreTable,
    Theta,
    apply,
    explore,
    finer_adhesion,
    widen,
)
from calibration.gap.landings.segments import LandingSegment, landing_of
from calibration.measurement import Interval, drawn_again
from onboard.arrays import FloatArray
from onboard.linear_algebra import on_one_thread
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Vehicle
from sim_backend.physics.parameters import physics_parameters

LEAST_LANDINGS = 4
"""Fewer cannot be held out against each other."""

COARSE_HORIZON = 0.12
"""s after the contact of the first search."""

UNEXPLAINED = 2.0
"""Median cost per residual above which landings are not explained."""

LEAST_CLEAN = 3
"""Landings without contact of the hull that suffice to see whether legs are explained."""

TELLING = 2.0
"""A stiffness that is known within this factor either way would have shown a change that matters."""


_FINER = (
    "the adhesion strength of {:.2g} N is that of the simulation as it is, in steps of 1 ms; in steps of "
    "0.25 ms it is {:.2g} N, which is what a pull test would show"
)


@dataclass(frozen=True)
class _Evidence:
    """Everything between the fits and the words."""

    problems: list[Problem]
    table: ScoreTable
    choice: Choice
    allowed: dict[str, dict[str, tuple[float, Interval]]]


@on_one_thread()
def judge_landings(flights: Sequence[Flight], vehicle: Vehicle, rng: np.random.Generator) -> LandingFindings:
    """Find which of leg_stiffness, leg_damping and foot_slip the landings in `flights` miss in `vehicle`.

    Args:
        flights: of any format, with gyro and pose, and motor commands if possible. Those without a landing
            are listed in the result.
        vehicle: the model; what is found is relative to it, effects that it declares included.
        rng: draws start states and bootstrap samples; the same generator state gives the same result.
    """
    landings, unused = _landings(flights)
    flip = flip_residual(landings, vehicle)
    problems: list[Problem] = []
    if vehicle.legs is not None and landings:
        problems, refused = pose_problems(landings, vehicle)
        unused += refused
    few = f"{len(problems)} usable landing(s); naming needs {LEAST_LANDINGS} that can be held out in turn"
    nothing = LandingFindings(
        verdict=Verdict.CANNOT_TELL,
        findings=(),
        allowed={},
        usable=tuple(problem.segment.name for problem in problems),
        misfit=None,
        limitations=("the vehicle has no legs" if vehicle.legs is None else few,),
        flip=flip,
        unused=tuple(unused),
    )
    if len(problems) < LEAST_LANDINGS:
        return replace(nothing, limitations=(*nothing.limitations, *limitations(problems, vehicle, 0.0)))
    evidence = _weigh(problems, vehicle, rng)
    table, choice = evidence.table, evidence.choice
    theta = choice.held_out[choice.model].theta if choice.model else None
    findings = _findings(evidence, vehicle, rng)
    words: tuple[str, ...] = ()
    if theta is not None and theta.adhesion < PERFECT:
        finer = _finer(problems, vehicle, theta, rng)
        findings = tuple(_up_to(finding, finer) for finding in findings)
        words = (_FINER.format(math.exp(theta.adhesion), finer),)
    left = misfit_left(table, theta or NOMINAL)
    words = (*words, *limitations(problems, vehicle, left))
    allowed = {
        effect: {name: interval for name, (_, interval) in parameters.items()}
        for effect, parameters in evidence.allowed.items()
    }
    misfit = float(np.median(table.ratios[NOMINAL]))
    return replace(
        nothing,
        verdict=_verdict(findings, left, allowed),
        findings=findings,
        allowed=allowed,
        misfit=misfit if math.isfinite(misfit) else None,
        limitations=words,
    )


def _landings(flights: Sequence[Flight]) -> tuple[list[LandingSegment], list[NotUsed]]:
    """Landings, each once, and the flights without."""
    found: list[LandingSegment] = []
    unused: list[NotUsed] = []
    for flight in flights:
        landing = landing_of(flight)
        if isinstance(landing, NotUsed):
            unused.append(landing)
            continue
        twin = next((other for other in found if np.array_equal(other.gyro, landing.gyro)), None)
        if twin is None:
            found.append(landing)
        else:
            unused.append(NotUsed(flight.name, f"the same landing as {twin.name}"))
    return found, unused


def _weigh(problems: list[Problem], vehicle: Vehicle, rng: np.random.Generator) -> _Evidence:
    parameters = physics_parameters(vehicle, RoomGeometry())
    coarse = Solver([shortened(p, COARSE_HORIZON) for p in problems], rng, random_starts=6, descents=1)
    fine = ScoreTable(Solver(problems, rng, random_starts=6, descents=2), parameters)
    best = explore(ScoreTable(coarse, parameters), fine)
    choice = choose(fine, best, rng)
    if choice.model:
        widen(fine, best[choice.model], choice.model)
        choice = choose(fine, best, rng)
    allowed = {
        model[0]: intervals(fine, choice.held_out[model], rng)[model[0]]
        for model in MODELS
        if len(model) == 1
    }
    return _Evidence(problems, fine, choice, allowed)


def _findings(evidence: _Evidence, vehicle: Vehicle, rng: np.random.Generator) -> tuple[FoundEffect, ...]:
    """One finding per accepted effect: errors before and after it, on landings that were held out."""
    table, choice = evidence.table, evidence.choice
    if not choice.model:
        return ()
    held_out = choice.held_out[choice.model]
    values = intervals(table, held_out, rng)
    steps = [(), *((effect,) for effect in choice.effects[:-1]), choice.model]
    errors = [held_out_errors(table, choice.held_out[model].chosen) for model in steps]
    return tuple(
        FoundEffect(
            name=effect,
            parameters=_parameters(effect, values[effect], at_bound(held_out.theta, effect), vehicle),
            **vars(improvement(before, after, rng)),
            ambiguous_with=choice.rivals,
            separated_by=separations([effect, *choice.rivals]),
        )
        for effect, before, after in zip(choice.effects, errors[:-1], errors[1:], strict=True)
    )


def _parameters(
    effect: str, values: Mapping[str, tuple[float, Interval]], bounds: Sequence[str], vehicle: Vehicle
) -> dict[str, FoundParameter]:
    """The parameters of an effect; what is a factor multiplies that of the vehicle file.

    `values` are relative to the file, with their intervals; `bounds` are those that ended at the end of what
    is searched.
    """
    filed = next((one.values() for one in vehicle.effects if one.name == effect), {})
    found = {}
    for name, (value, (low, high)) in values.items():
        factor = filed.get(name, 1.0) if name == "scale" else 1.0
        unit = EFFECTS[effect].parameters[name].unit
        ends = factor * low, factor * high
        found[name] = FoundParameter(value=factor * value, unit=unit, ci95=ends, at_bound=name in bounds)
    return found


def misfit_left(table: ScoreTable, theta: Theta) -> float:
    """Median cost per residual of landings on feet alone if there are LEAST_CLEAN of them, else of all.

    How a hull bounces and slides is an engineering estimate of the simulation: that it is wrong there says
    nothing about legs.
    """
    parameters = apply(table.parameters, theta)
    clean = [
        landing_trace(problem, parameters, table.starts[theta][index], HORIZON)[-1, BODY] == 0.0
        for index, problem in enumerate(table.solver.problems)
    ]
    ratios = table.ratios[theta]
    return float(np.median(ratios[clean] if sum(clean) >= LEAST_CLEAN else ratios))


def held_out_errors(table: ScoreTable, chosen: Sequence[Theta]) -> FloatArray:
    """RMS rate error (rad/s, (n,)) of each landing with the vehicle chosen without it."""
    return np.array(
        [
            rate_error(problem, apply(table.parameters, theta), table.starts[theta][index], EARLY)
            for index, (problem, theta) in enumerate(zip(table.solver.problems, chosen, strict=True))
        ]
    )


def _finer(problems: list[Problem], vehicle: Vehicle, theta: Theta, rng: np.random.Generator) -> float:
    """Adhesion strength (N) that a simulation in steps of 0.25 ms would find."""
    solver = Solver(problems, rng, random_starts=4, descents=2, iterations=3, parts=4)
    table = ScoreTable(solver, physics_parameters(vehicle, RoomGeometry()))
    return math.exp(finer_adhesion(table, theta))


def _up_to(finding: FoundEffect, strength: float) -> FoundEffect:
    """The finding with an interval of the adhesion strength that reaches `strength` (N) too."""
    if "adhesion_strength" not in finding.parameters:
        return finding
    found = finding.parameters["adhesion_strength"]
    low, high = found.ci95
    ends = min(low, strength * low / found.value), max(high, strength * high / found.value)
    reached = replace(found, ci95=ends)
    return replace(finding, parameters={**finding.parameters, "adhesion_strength": reached})


def improvement(before: FloatArray, after: FloatArray, rng: np.random.Generator) -> Improvement:
    """From errors (rad/s, (n,)) to that of their medians; for the interval landings are drawn again."""
    return Improvement.over(
        drawn_again(before.size, REPLICATES, rng),
        lambda landings: np.median(np.column_stack([before, after])[landings], axis=-2),
        "pitch and roll rate in the 0.3 s after contact, median over landings, rad/s",
    )


def _verdict(
    findings: Sequence[FoundEffect], left: float, allowed: dict[str, dict[str, Interval]]
) -> Verdict:
    if findings:
        return Verdict.EFFECTS_FOUND
    if left > UNEXPLAINED:
        return Verdict.UNEXPLAINED_GAP
    low, high = allowed["leg_stiffness"].get("scale", (1.0, 1.0))
    return Verdict.NO_GAP if high < TELLING and low > 1.0 / TELLING else Verdict.CANNOT_TELL
