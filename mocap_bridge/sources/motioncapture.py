"""What the library ``motioncapture`` reads (OptiTrack, Qualisys, VRPN, Vicon), from a child process.

The library tells neither when the cameras exposed nor a frame's number, latency or quality: capture time is
the receipt time, frames are counted here, and what the network delays is not seen. It knows no time-outs
either: a child that says nothing is killed when the stream is closed, which is what the bridge does after
0.5 s of silence.
"""

import json
import os
import selectors
import subprocess
import sys
import tempfile
from typing import Any

from mocap_bridge.errors import MocapError, SourceLost, SourceUnusable, UnknownSubject
from mocap_bridge.pose import PoseSample
from mocap_bridge.rotation import continuous
from mocap_bridge.sources.queued import QueuedStream
from mocap_bridge.uri import MocapUri
from onboard.timebase import Timebase

PREFIX = "motioncapture+"
OPEN_TIMEOUT_S = 5.0
"""For the interpreter to start, the library to load and the first pose to come."""
_NOT_INSTALLED = 3
_PORT_KEYS = {"optitrack": "port_command", "qualisys": "port"}
"""Settings that take the port; the others take it with the host name."""
_ABSENT_IS_NEWS = {"vrpn"}
"""Kinds whose frames name only the bodies that have moved on since the last one: absence is no occlusion."""


def open_motioncapture(uri: MocapUri, clock: Timebase) -> "MotionCaptureStream":
    """Start the child, and wait up to 5 s for a pose of the subject.

    Raises:
        SourceUnusable: the library is not installed, or refuses.
        SourceLost: nothing answers.
        UnknownSubject: frames come, our subject is not in them (a wrong name, or out of view).
    """
    return MotionCaptureStream(uri, clock).opened(OPEN_TIMEOUT_S)


class MotionCaptureStream(QueuedStream):
    """A running child (a ``PoseStream``)."""

    def __init__(self, uri: MocapUri, clock: Timebase) -> None:
        super().__init__(uri, clock)
        self._kind = uri.scheme.removeprefix(PREFIX)
        module = "mocap_bridge.sources.motioncapture_child"
        # Not a pipe: one that nobody empties would stop the child.
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self._child = subprocess.Popen(
            [sys.executable, "-m", module, self._kind, json.dumps(_settings(uri)), uri.subject],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
        )
        self._output = self._child.stdout.fileno() if self._child.stdout is not None else -1
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._output, selectors.EVENT_READ)
        self._rest = b""

    def find_subject(self, deadline: float) -> None:
        """Receive until our subject has a pose; errors as :func:`open_motioncapture`."""
        while all(sample.occluded for sample in self._samples):
            self._samples.clear()
            if not self._receive(deadline):
                break
        if self._samples:
            return
        if self._frames == 0 and not self._offered:
            raise SourceLost(f"{self._uri}: no frame within {OPEN_TIMEOUT_S:g} s; does the server run there?")
        offered = tuple(self._offered)
        raise UnknownSubject(
            f"{self._uri}: no pose of {self._uri.subject!r}, or it is out of view; seen: "
            f"{', '.join(map(repr, offered)) or 'none'}",
            offered,
        )

    def _receive(self, deadline: float) -> bool:
        """Take what the child has printed, waiting for it until `deadline`; False when that has passed."""
        remaining = deadline - self._clock()
        if remaining <= 0.0:
            return False
        if not self._selector.select(remaining):
            return True
        data = os.read(self._output, 65536)
        if not data:
            raise self._ended()
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._take(line)
        return True

    def _take(self, line: bytes) -> None:
        try:
            frame: dict[str, Any] = json.loads(line)
            t, pose, names = float(frame["t"]), frame["pose"], frame["names"]
        except (ValueError, TypeError, LookupError):  # the library prints on the same pipe
            self._refused += 1
            return
        self._offered.update(dict.fromkeys(names))
        if pose is None and self._kind in _ABSENT_IS_NEWS:
            return
        self._frames += 1
        position = None
        if pose is not None:
            x, y, z, *quaternion = pose
            position = (x, y, z)
            qx, qy, qz, qw = quaternion
            self._last = continuous((qx, qy, qz, qw), self._last)
        self._samples.append(
            PoseSample(
                subject=self._uri.subject,
                frame=self._frames,
                capture_time=t,
                receipt_time=t,
                position=position,
                quaternion=None if pose is None else self._last,
                occluded=pose is None,
            )
        )

    def _ended(self) -> MocapError:
        """Why the child has ended by itself."""
        code = self._child.wait()
        self._said.seek(0)
        last = self._said.read().decode("utf-8", "replace").strip().rpartition("\n")[2]
        if code == _NOT_INSTALLED:
            return SourceUnusable(
                f"{self._uri}: the library motioncapture is not installed ({last}): pip install motioncapture"
            )
        return SourceLost(f"{self._uri}: the library motioncapture ended with code {code}: {last}")

    def close(self) -> None:
        """Kill the child, which may hang or spin and would not end otherwise."""
        self._child.kill()
        self._child.wait()
        self._selector.close()
        for pipe in (self._child.stdin, self._child.stdout, self._said):
            if pipe is not None:
                pipe.close()


def _settings(uri: MocapUri) -> dict[str, str]:
    """The library's settings, all of them texts."""
    kind = uri.scheme.removeprefix(PREFIX)
    if kind in _PORT_KEYS:
        return {"hostname": uri.host, _PORT_KEYS[kind]: str(uri.port)}
    return {"hostname": f"{uri.host}:{uri.port}"}
