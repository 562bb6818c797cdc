"""Motor dynamics from a tachometer: edge times to speeds, steps, the speed law per direction, its constants.

:func:`analyse` is the whole way from recordings to a :class:`TachometerResult`; docs/bench_motors.md tells
the physics. Everything here is pure: files in, numbers and findings out.
"""

from calibration.tachometer.analysis import analyse
from calibration.tachometer.clock import ClockFit, fit_clock
from calibration.tachometer.errors import TachometerError
from calibration.tachometer.files import read_commands, read_tachometer, write_commands, write_edges
from calibration.tachometer.monitor import EdgeMonitor, EdgeQuality
from calibration.tachometer.propellers import PROPELLERS, PropellerMap, propeller
from calibration.tachometer.records import CommandRecord, EdgeRecord, WindowRecord
from calibration.tachometer.result import TachometerResult

__all__ = [
    "PROPELLERS",
    "ClockFit",
    "CommandRecord",
    "EdgeMonitor",
    "EdgeQuality",
    "EdgeRecord",
    "PropellerMap",
    "TachometerError",
    "TachometerResult",
    "WindowRecord",
    "analyse",
    "fit_clock",
    "propeller",
    "read_commands",
    "read_tachometer",
    "write_commands",
    "write_edges",
]
