"""Flights with a hidden effect, on which the gap finder is judged.

The program shares no equations with the simulation that the finder fits: its own integrator (RK4 at 2 kHz),
controller, effects, noise and log defects. The answers go to sealed files that the finder never reads.
"""

from tests.gap.truth.campaign import make_flights
from tests.gap.truth.cases import CASES
from tests.gap.truth.effects import SIZES

__all__ = ["CASES", "SIZES", "make_flights"]
