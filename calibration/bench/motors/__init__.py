"""Motor dynamics from a tachometer: edge times to speeds, steps, the speed law per direction, its constants.

:func:`analyse` is the whole way from recordings to a :class:`TachometerResult`; docs/bench_motors.md tells
the physics. Everything here is pure: files in, numbers and findings out.
"""

from calibration.bench.motors.analysis import analyse
from calibration.bench.motors.clock import ClockFit, fit_clock
from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.files import read_commands, read_tachometer, write_commands, write_edges
from calibration.bench.motors.monitor import EdgeMonitor, EdgeQuality
from calibration.bench.motors.propellers import PROPELLERS, PropellerMap, propeller
from calibration.bench.motors.records import CommandRecord, EdgeRecord, WindowRecord
from calibration.bench.motors.tachometer_result import TachometerResult

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
