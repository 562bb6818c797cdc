"""What a model without some of its effects, with another in their place, would explain: by one linear fit.

Every fit of a model anew costs a prediction of all flights per step. Most exchanges of names that are asked
about are hopeless, which the derivatives at the present model show: all from one table of products.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.gap.estimate.mixed import Products
from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.refine import Fitted, Training, prior_step
from calibration.gap.search.candidates import candidates
from calibration.gap.search.screen import held_out, products_with
from onboard.arrays import FloatArray


@dataclass(frozen=True)
class LinearLook:
    """Products of the columns of a fit, and of those of effects that might take a place in it.

    Attributes:
        present: the fit.
        training: its flights.
        products: of all columns: those of the fit, the responses to its variables, those of the others.
        offered: by effect that is not in the fit, its variables.
    """

    present: Fitted
    training: Training
    products: Products
    offered: dict[str, tuple[Variable, ...]]
    _known: dict[tuple[frozenset[str], str | None], FloatArray] = field(default_factory=dict, init=False)

    def lacks(self, without: Sequence[str], instead: str | None = None) -> FloatArray:
        """Held-out log-likelihood by which a model falls short of the fit, shape (2,): by shapes, by parts.

        The noise is that of the fit. A model that leaves more would call some of it noise, and falls less
        short: shares of what names explain are to be compared, not these numbers with those of fits.

        Args:
            without: effects of the fit that it has not.
            instead: effect that it has in their place, one of `offered`.
        """
        return self._likelihood(frozenset(), None) - self._likelihood(frozenset(without), instead)

    def _likelihood(self, without: frozenset[str], instead: str | None) -> FloatArray:
        """Held-out log-likelihood, shape (2,); computed once, as a name is asked about in many pairs."""
        if (without, instead) not in self._known:
            self._known[without, instead] = self._computed(without, instead)
        return self._known[without, instead]

    def _computed(self, without: frozenset[str], instead: str | None) -> FloatArray:
        present, count = self.present, len(self.present.columns)
        gone = [index for index, v in enumerate(present.variables) if v.effect in without]
        moved = np.zeros(self.products.xr.shape[1])
        moved[[count + index for index in gone]] = [present.model.change(present.variables[i]) for i in gone]
        kept = [index for index in range(count) if index not in gone]
        first = count + len(present.variables)
        for effect, variables in self.offered.items():
            if effect == instead:
                kept += range(first, first + len(variables))
            first += len(variables)
        own = () if instead is None else self.offered[instead]
        prior = present.prior.of(kept[: len(kept) - len(own)]).and_of(prior_step(present.model, own))
        products = _with_residual_moved(self.products, moved).of(kept)
        return held_out(products, prior, present.estimate.fit.spread, self.training)


def linear_look(present: Fitted, training: Training, effects: Collection[str]) -> LinearLook:
    """A look at a fit, and at those of `effects` that have a derivative at its model without another one."""
    offered: dict[str, tuple[Variable, ...]] = {}
    for left_out in (None, *present.model.effects):
        model = present.model if left_out is None else present.model.without(left_out)
        among = set(effects) - {*present.model.effects, *offered}
        for candidate in candidates(model, training.records, among) if among else ():
            if candidate.starts[0] is model:
                offered[candidate.effect] = candidate.variables
    asked = [*present.variables, *(v for variables in offered.values() for v in variables)]
    return LinearLook(present, training, products_with(present, asked, training), offered)


def _with_residual_moved(p: Products, by: FloatArray) -> Products:
    """The products where the residual is larger by the columns times `by`, shape (g,)."""
    return Products(
        zz=p.zz,
        zx=p.zx,
        xx=p.xx,
        zr=p.zr + p.zx @ by,
        xr=p.xr + p.xx @ by,
        rr=p.rr + 2.0 * p.xr @ by + p.xx @ by @ by,
        constant=p.constant,
    )
