"""Maps that are published as coefficients: the paper's table, and Bitcraze's cubics.

The paper prints its table under a logarithm. Its numbers are the quadratics f = a V^2 + b V + c (gf, V) of
its authors' code, one row up to 5 gf and one above (paper errata 1). Here they never meet a logarithm.
"""

from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.law import BREAK_GF
from onboard.csv_file import CsvFile
from onboard.gravity import GRAM_FORCE
from onboard.quantity import Quantity
from onboard.thrust_map import COEFFICIENT_UNITS, ThrustMapForm
from onboard.vehicle.model import ThrustMapDescription

PAPER_COLUMNS = frozenset({"motor", "region", "a", "b", "c"})
CUBIC_COLUMNS = frozenset({"combo", "c0", "c1", "c2", "c3"})
_PAPER = "paper table Battery Compensation Parameters (header misprint)"
_RELATIVE_SIGMA = 0.02
"""Engineering estimate: the paper states no uncertainty."""


def paper_maps(table: CsvFile) -> dict[str, ThrustMapDescription]:
    """The maps of the paper's table by motor (``stock``, ``upgraded``), as quadratics.

    Raises:
        ThrustTableError: a motor without both rows, or a cell that is no number.
    """
    values = {name: table.finite(name) for name in ("a", "b", "c")}
    maps: dict[str, ThrustMapDescription] = {}
    for motor in dict.fromkeys(table.text("motor")):
        place: dict[str, int] = {
            region: at
            for at, (name, region) in enumerate(zip(table.text("motor"), table.text("region"), strict=True))
            if name == motor
        }
        if set(place) != {"le5", "gt5"}:
            raise ThrustTableError(
                f"{table.path}: motor {motor!r} needs the regions le5 and gt5, has {sorted(place)}"
            )
        numbers_of = {
            f"{prefix}_{name}": (
                float(values[name][place[region]]),
                _RELATIVE_SIGMA * abs(float(values[name][place[region]])),
            )
            for prefix, region in (("low", "le5"), ("high", "gt5"))
            for name in ("a", "b", "c")
        }
        numbers_of["break_thrust"] = (BREAK_GF, 0.0)
        maps[motor] = _description(
            ThrustMapForm.QUADRATIC_INVERSE, numbers_of, GRAM_FORCE, f"{_PAPER}, {motor}"
        )
    return maps


def bitcraze_maps(table: CsvFile) -> dict[str, ThrustMapDescription]:
    """Bitcraze's cubics by motor and propeller (``L250`` ...)."""
    values = {name: table.finite(name) for name in ("c0", "c1", "c2", "c3")}
    return {
        name: _description(
            ThrustMapForm.FIRMWARE_CUBIC,
            {c: (float(values[c][at]), 0.03 * abs(float(values[c][at]))) for c in values},
            1.0,
            f"Bitcraze 2025, crazyflie-firmware platform defaults, {name}; 3 % of spread is an "
            "engineering estimate",
        )
        for at, name in enumerate(table.text("combo"))
    }


def _description(
    form: ThrustMapForm, values: dict[str, tuple[float, float]], to_si: float, source: str
) -> ThrustMapDescription:
    return ThrustMapDescription(
        form=form,
        coefficients={
            name: Quantity(values[name][0] * to_si, unit, values[name][1] * to_si, source)
            for name, unit in COEFFICIENT_UNITS[form].items()
        },
    )
