"""The compiled core with typed functions: what Python calls of ``core`` and ``host``."""

import ctypes
from ctypes import POINTER, c_bool, c_char_p, c_float, c_uint8, c_uint32, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from onboard.errors import OnboardError
from onboard.firmware import structures as s
from onboard.firmware.compiler import compiled_library
from onboard.firmware.constants import onboard_constants
from onboard.vehicle import Vehicle

Float32Array = NDArray[np.float32]

NO_POSE = 0xFFFFFFFF
"""Age of the last pose (ms) where there was none."""

_CORE, _VEHICLE, _FLOATS = c_void_p, POINTER(c_float), c_void_p

_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "perch_boot": (None, (_CORE, _VEHICLE)),
    "perch_post": (c_uint32, (_CORE, c_bool, POINTER(s.PerchApproach))),
    "perch_is_consumed": (c_bool, (_CORE, c_uint32)),
    "perch_arm_policy": (c_bool, (_CORE, c_bool)),
    "perch_ask_go": (None, (_CORE, c_bool)),
    "perch_ask_abort": (None, (_CORE, c_bool)),
    "perch_rehearse": (c_uint8, (_CORE, c_uint8, c_bool)),
    "perch_set_ceiling": (None, (_CORE, c_float)),
    "perch_commit": (c_uint32, (_CORE, c_uint32, c_uint32, c_bool)),
    "perch_live_crc": (c_uint32, (_CORE,)),
    "perch_memory_size": (c_uint32, ()),
    "perch_memory_read": (c_bool, (_CORE, c_uint32, c_uint32, c_char_p)),
    "perch_memory_write": (c_bool, (_CORE, c_uint32, c_uint32, c_char_p, c_bool)),
    "perch_vehicle_crc": (c_uint32, (_VEHICLE,)),
    "perch_host_sizes": (None, (POINTER(c_uint32),)),
    "perch_host_step": (None, (_CORE, POINTER(s.PerchInputs), POINTER(s.PerchView))),
    "perch_host_policy": (c_uint32, (c_char_p, c_uint32, c_uint32, _FLOATS, _FLOATS, _FLOATS)),
    "perch_host_cues": (None, (c_uint32, _FLOATS, _FLOATS)),
    "perch_host_control": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS, _FLOATS, _FLOATS, _FLOATS)),
    "perch_host_level": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS, _FLOATS, _FLOATS)),
    "perch_host_lead": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS, c_float, _FLOATS)),
    "perch_host_mix": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS)),
    "perch_host_flip": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS)),
    "perch_host_duty": (None, (_VEHICLE, c_uint32, _FLOATS, _FLOATS, _FLOATS)),
    "perch_host_plan": (None, (c_uint32, _FLOATS, _FLOATS)),
    "perch_host_approach": (None, (POINTER(s.PerchPlan), c_uint32, _FLOATS, c_float, _FLOATS, _FLOATS)),
    "perch_host_stopping": (None, (c_uint32, _FLOATS, _FLOATS)),
    "perch_host_model": (None, (_VEHICLE, c_uint32, _FLOATS, c_float)),
    "perch_host_landing": (
        None,
        (
            POINTER(s.PerchLandingMemory),
            POINTER(s.PerchLandingInputs),
            POINTER(s.PerchPlan),
            _VEHICLE,
            POINTER(s.PerchLandingOutput),
        ),
    ),
}


class WrongLayout(OnboardError):
    """The library's structures are not those of :mod:`onboard.firmware.structures`."""


class CoreLibrary:
    """The functions of one compiled core, each as an attribute with its name in C.

    Args:
        path: the shared library.

    Attributes:
        core_bytes: size of a ``perch_core``.
    """

    def __init__(self, path: Path) -> None:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        self._library = library
        sizes = (c_uint32 * 4)()
        self.perch_host_sizes(sizes)
        self.core_bytes = int(sizes[0])
        believed = [ctypes.sizeof(part) for part in (s.PerchInputs, s.PerchView, s.PerchRecorder)]
        if list(sizes[1:]) != believed:
            raise WrongLayout(f"{path}: its structures have {list(sizes[1:])} bytes, not {believed}")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)


@cache
def core_library() -> CoreLibrary:
    """The core of the present sources, compiled if need be.

    Raises:
        NoCompiler, CompilationFailed: see :mod:`onboard.firmware.compiler`.
    """
    return CoreLibrary(compiled_library())


def vehicle_constants(vehicle: Vehicle) -> ctypes.Array[c_float]:
    """A ``perch_vehicle``: the constants of a vehicle as float32."""
    values = [constant.value for constant in onboard_constants(vehicle)]
    return (c_float * len(values))(*values)
