"""Child process: read frames with `motioncapture` and print one JSON line a frame. Killed by its parent.

``motioncapture`` never returns from `connect` without a server and spins when the server closes, so it only
ever runs in a process of its own. Usage: motioncapture_reader.py HOST:PORT FRAMES
"""

import json
import sys
import time

import motioncapture
import numpy as np


def main(address: str, frames: int) -> None:
    """Print ``{"t", "bodies": {name: [x, y, z, qx, qy, qz, qw]}}`` for each of `frames` frames."""
    np.zeros(1)  # the wheel imports numpy at its first position, which would cost frames
    capture = motioncapture.connect("vicon", {"hostname": address})
    lines = []
    while len(lines) < frames:
        capture.waitForNextFrame()
        receipt_time = time.monotonic()
        bodies = {}
        for name, body in capture.rigidBodies.items():
            q = body.rotation
            bodies[name] = [*(float(value) for value in body.position), q.x, q.y, q.z, q.w]
        lines.append({"t": receipt_time, "bodies": bodies})
    for line in lines:
        sys.stdout.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
