"""Flight logs as CSV of the `table` format, as an operator would have them."""

from pathlib import Path

import numpy as np

from tests.truth.hidden_effects.layout import CONTROL_PERIOD, TICKS_PER_SAMPLE

HEADER = "t,x,y,z,qx,qy,qz,qw,gx,gy,gz,ax,ay,az,m1,m2,m3,m4,vbat"
SAMPLE_PERIOD = CONTROL_PERIOD * TICKS_PER_SAMPLE
_ROW = "%.3f" + ",%.6f" * 3 + ",%.7f" * 4 + ",%.5f" * 3 + ",%.5f" * 3 + ",%.2f" * 4 + ",%.4f\n"
_WHOLE_ROW = _ROW.replace(",%.2f", ",%d")


def write_log(path: Path, log: np.ndarray) -> None:
    """Write samples (shape (m, 18), columns as in `kernel.fly`) with their time."""
    table = np.column_stack([np.arange(len(log)) * SAMPLE_PERIOD, log])
    pwm = log[:, 13:17]
    row = _WHOLE_ROW if np.array_equal(pwm, np.floor(pwm)) else _ROW
    path.write_text(f"{HEADER}\n" + row * len(table) % tuple(table.ravel().tolist()))
