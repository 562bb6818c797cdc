"""Child process: reads poses with the library ``motioncapture`` and prints one JSON line a frame.

    python -m mocap_bridge.sources.motioncapture_child TYPE '{"hostname": "..."}' SUBJECT

A line is ``{"t": receipt time, "names": [...], "pose": [x, y, z, qx, qy, qz, qw] or null}``. The library
never returns from `connect` where nobody answers, and spins when a server ends, so it lives here, where it
can be killed; and it dies with whoever started it.
"""

import ctypes
import json
import os
import signal
import sys
import threading
import time

_SET_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2): Linux kills us with our parent, also in a call that never returns."""


def main(kind: str, settings: str, subject: str) -> int:
    """Print frames until killed; exit code 3 says that the library is not installed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    try:
        import motioncapture
    except ImportError as error:
        sys.stderr.write(f"{error}\n")
        return 3
    import numpy as np

    np.zeros(1)  # the library imports numpy at its first position, which would cost frames
    capture = motioncapture.connect(kind, json.loads(settings))
    while True:
        capture.waitForNextFrame()
        now = time.monotonic()
        bodies = capture.rigidBodies
        body = bodies.get(subject)
        pose = None
        if body is not None:
            q = body.rotation
            pose = [*(float(value) for value in body.position), q.x, q.y, q.z, q.w]
        sys.stdout.write(json.dumps({"t": now, "names": sorted(bodies), "pose": pose}) + "\n")
        sys.stdout.flush()


def _die_with_parent() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
