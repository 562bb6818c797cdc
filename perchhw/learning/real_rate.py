"""What a lab should expect of a policy's real flights: simulated rates with the model's known error.

How far this simulation's rates are from real ones is known from flights of known outcome (`perchhw gap
landings`, ``expectation.model_error``): the authors' for the vehicle file that was found with them, a lab's
own for any other.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.gap.landings.outcomes.expectation import Expectation, ModelError, expect
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.learning.judged_range import JUDGED_FLIGHTS
from perchhw.learning.launch_file import read_landings
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep_folder import Row

AUTHORS_ERROR = ModelError(mean=(-0.03, 1.05), sigma=(0.43, 0.37), correlation=0.28, flights=JUDGED_FLIGHTS)
"""Of :data:`DEFAULT_VEHICLE` with its own legs on the authors' flights: `perchhw gap landings --data FLIGHTS
--vehicle crazyflie21-upgraded --draws 400`. Three of the vehicle's numbers come from the same flights."""


def known_error(setup: LearningSetup, landings: Path | None) -> ModelError | None:
    """How wrong the simulation of a setup is known to be; None: no flight tells.

    Args:
        setup: vehicle and legs.
        landings: ``landings.json`` of a lab's own flights, with this vehicle or the one from which it was
            found; None: the authors'.

    Raises:
        LearningInputError: the file cannot be read.
        ModelErrorFileError: it does not say, or of another vehicle.
    """
    if landings is not None:
        vehicle: str = setup.describe()["vehicle_sha256"]
        return ModelError.from_document(read_landings(landings), vehicle, str(landings))
    own_legs = setup.legs is None and setup.leg_angle_deg is None and setup.leg_length_m is None
    return AUTHORS_ERROR if setup.vehicle == DEFAULT_VEHICLE and own_legs else None


def real_rate(rows: Sequence[Row], error: ModelError, seed: int) -> Expectation:
    """What to expect of flights over all conditions of a validation, on any four legs.

    Args:
        rows: of the validation. error: of the model. seed: of the draws.
    """
    triggers = np.array([float(row["trigger_rate"] or 0.0) for row in rows])
    four = np.array([float(row["four_leg_rate"] or 0.0) for row in rows])
    of_flips = np.divide(four, triggers, out=np.zeros_like(four), where=triggers > 0.0)
    return expect(error, np.minimum(of_flips, 1.0), np.random.default_rng([seed, 4]), triggers)
