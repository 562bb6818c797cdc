"""The true state of every drone as a CSV file, for those who judge what the flight stack believed."""

from io import TextIOWrapper
from pathlib import Path
from typing import Any

from onboard.closing import Closing
from sim_backend.errors import SimulationError

COLUMNS = "t,drone,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz,legs_attached,body_contact"
MOTOR_COLUMN = "motor_max"
RATE_HZ = 100
FLUSH_PERIOD_S = 0.1


class TruthError(SimulationError):
    """The truth file cannot be written."""


class TruthRecorder(Closing):
    """Appends one row a drone and sample; rows reach the operating system every 0.1 s of world time.

    Columns: t [s of world time], drone (its name), position [m] and velocity [m/s] in the world frame,
    quaternion body to world, body rates [rad/s], number of feet that adhere, whether body or a
    propeller has touched the ceiling since the last reset; with `motors` the largest of the four motor
    commands (0..65535).
    """

    def __init__(self, path: Path, motors: bool = False) -> None:
        self._motors = motors
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: TextIOWrapper = path.open("w", encoding="ascii", newline="")
        except OSError as error:
            raise TruthError(f"--truth {path}: {error}; give a file that can be written") from error
        self._flushed = 0.0
        self._file.write((f"{COLUMNS},{MOTOR_COLUMN}" if motors else COLUMNS) + "\n")
        self._file.flush()

    def record(self, t: float, drone: str, state: Any, motor_max: int) -> None:
        """One row from a record of :data:`sim_backend.physics.state.STATE`."""
        numbers = [
            *state["position"],
            *state["quaternion"],
            *state["velocity"],
            *state["omega"],
        ]
        text = ",".join(f"{number:.6g}" for number in numbers)
        legs = int(state["foot_attached"].sum())
        last = f",{motor_max}" if self._motors else ""
        self._file.write(f"{t:.3f},{drone},{text},{legs},{int(state['body_contact'])}{last}\n")
        if t - self._flushed >= FLUSH_PERIOD_S:
            self._file.flush()
            self._flushed = t

    def close(self) -> None:
        """Write what is left and close the file."""
        self._file.close()
