"""The public tables of thrust against voltage that come with the project's data."""

import numpy as np

from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.units import LARGEST_READING
from onboard.arrays import FloatArray
from onboard.csv_file import CsvFile
from onboard.gravity import GRAM_FORCE

BITCRAZE_2015 = frozenset({"amps", "thrust_g", "volt", "pwm_pct_fixed", "rpm"})
FOERSTER = frozenset({"cmd", "thrust_N"})

_FOERSTER_SUPPLY = 4.0
"""V: what the authors' digitised points take for the supply; the thesis' own reading is not recorded."""
_IDLE_COMMAND = 200.0
"""Points below are the idle pair of the digitised figure."""


def bitcraze_2015(table: CsvFile) -> ThrustData:
    """Bitcraze's table of 2015: total thrust of four motors in g, supply, duty in percent.

    The duty is the table's, corrected where it has a typo; rows at rest do not enter.
    """
    total, volt, percent = (
        table.finite(name, largest=LARGEST_READING) for name in ("thrust_g", "volt", "pwm_pct_fixed")
    )
    turning = total > 0.0
    return ThrustData(
        name=table.path.name,
        source="Bitcraze 2015, crazyflie-firmware docs, pwm-to-thrust (GPL-3.0)",
        voltage=(volt * percent / 100.0)[turning],
        thrust=(total / 4.0 * GRAM_FORCE)[turning],
        block=interleaved(int(turning.sum())),
    )


def foerster(table: CsvFile) -> ThrustData:
    """Foerster's points, digitised: command 0..65535, thrust of one motor in N; supply taken as 4.0 V."""
    command, thrust = (table.finite(name, largest=LARGEST_READING) for name in ("cmd", "thrust_N"))
    # A digitised point that falls behind those of lower commands lies where the figure's curve ends.
    turning = (command > _IDLE_COMMAND) & (thrust >= np.maximum.accumulate(thrust))
    return ThrustData(
        name=table.path.name,
        source="Foerster 2015, ETH Zurich, points digitised by B. Habas",
        voltage=(command / 65535.0 * _FOERSTER_SUPPLY)[turning],
        thrust=thrust[turning],
        block=interleaved(int(turning.sum())),
    )


def interleaved(count: int) -> FloatArray:
    """Blocks of a table that has one sweep only: every fifth point, so that each spans the whole range."""
    return np.arange(count, dtype=np.float64) % 5.0
