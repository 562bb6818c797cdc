"""Flights with a hidden effect, on which the gap finder is judged.

The program shares no equations with the simulation that the finder fits: its own integrator (RK4 at 2 kHz),
controller, effects, noise and log defects. The answers go to sealed files that the finder never reads.

An answer is a JSON document: `verdict` as the report's; `effects`, each with `name`, `parameters` (SI, names
as in a vehicle file), `acceptable_ambiguous` (names that may stand beside it) and `derived` where the
parameters share their work; `unlisted` (channel, regressor, range or frequency) for what no name fits.
"""

from tests.truth.hidden_effects.campaign import make_flights
from tests.truth.hidden_effects.cases import CASES
from tests.truth.hidden_effects.effects import SIZES

__all__ = ["CASES", "SIZES", "make_flights"]
