"""What a report shows of a search: where the gap lived, what is left of it, and the figures."""

import dataclasses
from collections.abc import Mapping, Sequence

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import CHANNELS
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.replay import PredictionErrors, fly_again
from calibration.gap.replay.closed_loop import ClosedLoopFlight
from calibration.gap.report.document import Gap, Rejected, Unexplained, UnnamedTerms, Where
from calibration.gap.report.effect_pictures import along_regressor, effect_pictures
from calibration.gap.report.figures_data import AlongRegressor, ReportFigures
from calibration.gap.report.prediction_figures import stage_gaps
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import Named
from calibration.gap.search.unnamed_curves import UnnamedCurves
from calibration.gap.unnamed.fitted_terms import FittedTerm, formulas
from calibration.gap.unnamed.gap_map import GapMap
from calibration.gap.unnamed.regressors import regressors
from calibration.gap.unnamed.structure import LEAST_SHARE, LEVEL
from onboard.vehicle import Vehicle

_PLACES = 8
_CLOUDS = 4


def where(before: GapMap) -> tuple[Where, ...]:
    """Where the gap lived before anything was added, largest share first."""
    return tuple(
        Where(channel=cell.channel.name, condition=cell.condition, share=float(cell.share))
        for cell in before.cells
        if cell.p < LEVEL and cell.share >= LEAST_SHARE
    )[:_PLACES]


def unexplained(
    terms: Sequence[FittedTerm], final: Fitted, names: Named, vehicle: Vehicle, left: Sequence[str]
) -> Unexplained:
    """What has no name; its share is of the residual's variance in the channel where most of it lives."""
    structures = [one.structure for one in terms]
    formula_words = formulas(final, [one.term for one in terms], vehicle)
    goes_with = [text for f in structures for text in (f.regressor, f.condition, *f.alike)]
    return Unexplained(
        share=max((float(structure.share) for structure in structures), default=0.0),
        channels=tuple(dict.fromkeys(structure.channel.name for structure in structures)),
        suspects=tuple(dict.fromkeys([*goes_with, *names.unconfirmed, *left])),
        formula="; ".join(formula_words) or None,
    )


def unnamed_in_report(unnamed: UnnamedCurves, by_names: Gap, gap: Gap) -> UnnamedTerms:
    """What is said of terms without a name; the gap with names alone, and with what is written."""
    closes = dataclasses.replace(by_names.overall, before=by_names.overall.after, after=gap.overall.after)
    return UnnamedTerms(
        written=tuple(unnamed.curves),
        refused=tuple(Rejected(name=name, reason=reason) for name, reason in unnamed.refused.items()),
        closes=closes if unnamed.curves else None,
    )


def figures(
    stages: Mapping[str, PredictionErrors],
    names: Named,
    held_out: Sequence[FlightRecord],
    found: Search,
    training: Training,
    maps: tuple[GapMap, GapMap],
) -> ReportFigures:
    """Everything that the page draws."""
    return ReportFigures(
        effects=effect_pictures(names.effects, found.final, training),
        stages=stage_gaps(stages),
        heat_map=maps,
        clouds=_clouds(maps[0], found, training),
        closed_loop=_flown_again(names, held_out),
    )


def _clouds(before: GapMap, found: Search, training: Training) -> tuple[AlongRegressor, ...]:
    """Residuals against the regressors that explained most, before and after, averaged over 0.1 s."""
    along = {regressor.name: regressor for regressor in regressors(training.records)}
    signals = training.regression.signals
    clouds: list[AlongRegressor] = []
    for cell in before.cells:
        if len(clouds) == _CLOUDS or cell.p >= LEVEL:
            break
        if cell.channel.frame == "world":
            continue
        index = CHANNELS.index(cell.channel.signal)
        residuals = found.first.estimate.residual[:, index], found.final.estimate.residual[:, index]
        regressor = along[cell.regressor.name]
        clouds.append(along_regressor(regressor, cell.channel.signal, residuals, signals))
    return tuple(clouds)


def _flown_again(names: Named, held_out: Sequence[FlightRecord]) -> dict[str, ClosedLoopFlight]:
    """The first flight that both models can fly again, in closed loop."""
    models = names.models()
    ends: dict[str, Model] = {"before": models["before"], "with all": list(models.values())[-1]}
    for record in held_out:
        flown = {name: fly_again(record, model.vehicle()) for name, model in ends.items()}
        whole = {name: flight for name, flight in flown.items() if flight is not None}
        if len(whole) == len(ends):
            return whole
    return {}
