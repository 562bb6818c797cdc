"""The whole landing app, shell included, on a firmware that is in the test's hands (``shim``)."""

import ctypes
import struct
import subprocess
from ctypes import POINTER, Structure, c_bool, c_char_p, c_float, c_int, c_uint8, c_uint16, c_uint32
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeAlias

from onboard.app_interface import ValueType
from onboard.firmware.compiler import FLAGS, SOURCES, needed_compiler
from onboard.firmware.header import vehicle_header
from onboard.firmware.structures import PerchOutputs
from onboard.vehicle import Vehicle

SHIM = Path(__file__).parent / "shim"

Fields: TypeAlias = list[tuple[str, Any]]

PARAMETER_TYPES = {
    0x08: ValueType.UINT8, 0x09: ValueType.UINT16, 0x0A: ValueType.UINT32, 0x06: ValueType.FLOAT
}  # fmt: skip
LOG_TYPES = {1: ValueType.UINT8, 2: ValueType.UINT16, 3: ValueType.UINT32, 7: ValueType.FLOAT}
READ_ONLY = 0x40
FORMATS = {
    ValueType.UINT8: "<B", ValueType.UINT16: "<H", ValueType.UINT32: "<I", ValueType.FLOAT: "<f"
}  # fmt: skip


class Vector(Structure):
    """``vector_t`` and ``attitude_t``."""

    _fields_: ClassVar[Fields] = [(name, c_float) for name in "xyz"]


class Quaternion(Structure):
    """``quaternion_t``."""

    _fields_: ClassVar[Fields] = [(name, c_float) for name in "xyzw"]


class Sensors(Structure):
    """``sensorData_t``: g and deg/s."""

    _fields_: ClassVar[Fields] = [("acc", Vector), ("gyro", Vector)]


class State(Structure):
    """``state_t``."""

    _fields_: ClassVar[Fields] = [("quaternion", Quaternion), ("position", Vector), ("velocity", Vector)]


class Setpoint(Structure):
    """``setpoint_t``: deg, legacy sign of pitch."""

    _fields_: ClassVar[Fields] = [
        ("timestamp", c_uint32),
        ("attitude", Vector),
        ("rates", Vector),
        ("quaternion", Quaternion),
        ("thrust", c_float),
        ("position", Vector),
        ("velocity", Vector),
        ("acceleration", Vector),
        ("velocity_body", c_bool),
        *((f"mode_{name}", c_uint32) for name in ("x", "y", "z", "roll", "pitch", "yaw", "quat")),
    ]


class Control(Structure):
    """``control_t``."""

    _fields_: ClassVar[Fields] = [("forces", c_float * 4), ("mode", c_uint32)]


class World(Structure):
    """``shim_world``."""

    _fields_: ClassVar[Fields] = [
        ("tick_ms", c_uint32),
        ("voltage", c_float),
        ("flying", c_bool),
        ("armed", c_bool),
        ("pose_tick", c_uint16),
        ("motors", c_uint16 * 4),
        ("app_late_ms", c_uint32),
        ("motor_override", c_uint8),
        ("estimator", c_uint8),
        ("idle_thrust", c_uint32),
    ]


class Asked(Structure):
    """``shim_asked``."""

    _fields_: ClassVar[Fields] = [
        *(
            (name, c_uint32)
            for name in ("planner_stops", "planner_goals", "priorities_relaxed", "pid_steps", "disarmings")
        ),
        ("goal", c_float * 3),
    ]


class Variable(NamedTuple):
    """A parameter or log variable as the firmware's tables have it."""

    name: str
    type: ValueType
    read_only: bool = False


INTERRUPTIBLE = ("-finstrument-functions", "-Dmemcpy=shim_copy")
"""Flags of a build whose tasks can be interrupted wherever a function begins or ends, and where bytes are
copied."""

ANSWERS = (
    "shim_write",
    "shim_parameter_task_waits",
    "shim_memory_task_waits",
    "shim_memory_read",
    "shim_memory_write",
    "shim_memory_was_written",
)
"""What the shim answers with yes or no."""


def build_shell(folder: Path, vehicle: Vehicle, *further: str) -> Path:
    """Compile app, core and shim for one vehicle, with these flags as well."""
    (folder / "perch_vehicle_constants.h").write_text(vehicle_header(vehicle), encoding="utf-8")
    library = folder / "shell.so"
    places = (folder, SHIM / "include", SHIM, SOURCES / "core")
    sources = [
        str(file)
        for place in (SOURCES / "core", SOURCES / "app" / "src", SHIM)
        for file in sorted(place.glob("*.c"))
    ]
    flags = [flag for flag in FLAGS if flag != "-std=c11"]
    command = [needed_compiler(), "-std=gnu11", *flags, *further, "-fPIC", "-shared"]
    command += [*(f"-I{place}" for place in places), *sources, "-lm", "-o", str(library)]
    subprocess.run(command, check=True)
    return library


class Shell:
    """One booted app. The library holds one: load another copy of the file for another app."""

    def __init__(self, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.shim_the_world.restype = POINTER(World)
        self._library.shim_what_was_asked.restype = POINTER(Asked)
        self._library.shim_what_came_out.restype = POINTER(PerchOutputs)
        for name in ("shim_parameter_name", "shim_log_name"):
            getattr(self._library, name).restype = c_char_p
        for name in ANSWERS:
            getattr(self._library, name).restype = c_bool
        self._library.shim_live_policy.restype = POINTER(c_uint8)
        self.world: World = self._library.shim_the_world().contents
        self.asked: Asked = self._library.shim_what_was_asked().contents
        self.outputs: PerchOutputs = self._library.shim_what_came_out().contents
        self.state, self.sensors, self.setpoint, self.control = State(), Sensors(), Setpoint(), Control()
        self.state.quaternion.w = 1.0
        self.step_number = 1
        self._library.shim_boot()
        self._types = {variable.name: variable.type for variable in self.parameters()}
        self._log_types = {variable.name: variable.type for variable in self.logs()}

    def parameters(self) -> list[Variable]:
        """All parameters, in the order of their groups' sources."""
        return [
            Variable(name, PARAMETER_TYPES[code & ~READ_ONLY], bool(code & READ_ONLY))
            for name, code in self._table("shim_parameter_name")
        ]

    def logs(self) -> list[Variable]:
        """All log variables."""
        return [Variable(name, LOG_TYPES[code]) for name, code in self._table("shim_log_name")]

    def _table(self, function: str) -> list[tuple[str, int]]:
        rows: list[tuple[str, int]] = []
        code = c_uint8()
        while (name := getattr(self._library, function)(len(rows), ctypes.byref(code))) is not None:
            rows.append((name.decode(), code.value))
        return rows

    def write(self, name: str, value: float) -> bool:
        """Write a parameter; its callback runs until it ends or waits."""
        data = struct.pack(FORMATS[self._types[name]], value)
        return bool(self._library.shim_write(name.encode(), data, c_int(len(data))))

    def set(self, name: str, value: float) -> None:
        """Write a parameter, and step the control loop until its callback has ended."""
        assert self.write(name, value)
        while self.callback_waits:
            self.step()

    @property
    def callback_waits(self) -> bool:
        """Whether the callback of the last write waits for the control loop."""
        return bool(self._library.shim_parameter_task_waits())

    def read(self, name: str) -> float:
        """Value of a parameter."""
        return self._read("shim_read_parameter", name, self._types[name])

    def log(self, name: str) -> float:
        """Value of a log variable."""
        return self._read("shim_read_log", name, self._log_types[name])

    def _read(self, function: str, name: str, kind: ValueType) -> float:
        data = ctypes.create_string_buffer(8)
        size = getattr(self._library, function)(name.encode(), data)
        value: float = struct.unpack(FORMATS[kind], data.raw[:size])[0]
        return value

    def step(self, milliseconds: int = 1) -> None:
        """So many turns of the control loop, the parameter task after each, the app's task when it wakes."""
        for _ in range(milliseconds):
            self.world.tick_ms += 1
            self._library.shim_control(
                *(ctypes.byref(part) for part in (self.control, self.setpoint, self.sensors, self.state)),
                c_uint32(self.step_number),
            )
            self.step_number += 1
            self._library.shim_go_on_with_parameters()
            self._library.shim_go_on_with_app()

    def step_another_controller(self, milliseconds: int) -> None:
        """So many turns of a control loop in which another controller is chosen; the app's task goes on."""
        for _ in range(milliseconds):
            self.world.tick_ms += 1
            self.step_number += 1
            self._library.shim_go_on_with_parameters()
            self._library.shim_go_on_with_app()

    def leave_to_another_controller(self, milliseconds: int) -> None:
        """Somebody chooses another controller (`stabilizer.controller`), and then ours again."""
        self.world.tick_ms += milliseconds
        self.step_number += milliseconds
        self._library.shim_choose_controller()

    def upload(self, data: bytes) -> None:
        """Write to the app's memory from 0 on, in packets of 25 bytes."""
        for start in range(0, len(data), 25):
            assert self.write_memory(start, data[start : start + 25])

    def write_memory(self, address: int, data: bytes) -> bool:
        """One packet."""
        return bool(self._library.shim_memory_write(c_uint32(address), c_uint8(len(data)), data))

    def interrupt_parameters(self, place: int) -> None:
        """Interrupt the callback of the next write at this place, from 1 on; 0: nowhere."""
        self._library.shim_interrupt_parameters(c_int(place))

    def interrupt_app(self, place: int) -> None:
        """Interrupt the app's slow task at this place, from 1 on, until the next turn of the control loop."""
        self._library.shim_interrupt_app(c_int(place))

    def go_on_with_parameters(self) -> None:
        """Let the interrupted callback go on."""
        self._library.shim_go_on_with_parameters()

    def begin_memory_write(self, address: int, data: bytes, place: int) -> None:
        """One packet, whose task is interrupted at this place, from 1 on."""
        self._library.shim_interrupt_memory(c_int(place))
        self._library.shim_begin_memory_write(c_uint32(address), c_uint8(len(data)), data)

    @property
    def memory_waits(self) -> bool:
        """Whether that write has not ended."""
        return bool(self._library.shim_memory_task_waits())

    def end_memory_write(self) -> bool:
        """Let it go on; whether it was accepted."""
        self._library.shim_go_on_with_memory()
        return bool(self._library.shim_memory_was_written())

    def live_policy(self, length: int) -> bytes:
        """The first bytes of what the control loop takes for its policy."""
        return ctypes.string_at(self._library.shim_live_policy(), length)

    def read_memory(self, address: int, length: int) -> bytes | None:
        """One packet; None where it is refused."""
        buffer = ctypes.create_string_buffer(255)
        if not self._library.shim_memory_read(c_uint32(address), c_uint8(length), buffer):
            return None
        return buffer.raw[:length]

    @property
    def memory_size(self) -> int:
        """Bytes that the memory says it has."""
        size: int = self._library.shim_memory_size()
        return size
