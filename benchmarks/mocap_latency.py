"""How long from a Vicon DataStream server's send to a pose in Python: our client beside `motioncapture`.

Both clients read the same server in the same run, each in a process of its own; times are of the machine's
one monotonic clock. `motioncapture` 1.1 holds Vicon's SDK; without it only our client is measured. Prints one
JSON document:

    python benchmarks/mocap_latency.py [--seconds 10] [--rate 100] [--bodies 2]
"""

import argparse
import asyncio
import importlib.util
import json
import os
import platform
import sys
import time
from collections.abc import Callable

import numpy as np

from mocap_bridge.pose import open_pose_stream
from sim_backend.room.cameras import CameraFrame, SeenBody
from sim_backend.room.datastream_server import DataStreamServer
from sim_backend.room.feed import TruePose

WARM_UP_S = 1.0


def read_ours(port: int, frames: int) -> list[tuple[int, float]]:
    """Frame number and the time at which the pose was in hand, `frames` times, by our client."""
    with open_pose_stream(f"vicon://127.0.0.1:{port}?subject=beacon") as stream:
        got: list[tuple[int, float]] = []
        while len(got) < frames:
            sample = stream.read(1.0)
            got.append((sample.frame - 1, time.monotonic()))
    return got


def read_motioncapture(port: int, frames: int) -> list[tuple[int, float]]:
    """The same by `motioncapture`, which hides the frame number: it is in the beacon's position."""
    import motioncapture

    capture = motioncapture.connect("vicon", {"hostname": f"127.0.0.1:{port}"})
    got: list[tuple[int, float]] = []
    while len(got) < frames:
        capture.waitForNextFrame()
        beacon = capture.rigidBodies.get("beacon")
        if beacon is not None:
            position, _ = beacon.position, beacon.rotation
            now = time.monotonic()
            got.append((round(float(position[0]) * 1000.0), now))
    return got


READERS: dict[str, Callable[[int, int], list[tuple[int, float]]]] = {
    "perchhw": read_ours,
    "motioncapture": read_motioncapture,
}


async def measure(rate: float, seconds: float, bodies: int, readers: list[str]) -> dict[str, object]:
    """Serve frames until every reader has its own; join their receipt times with our send times."""
    server = DataStreamServer(rate)
    port = await server.start("127.0.0.1", 0)
    frames = int(rate * seconds)
    children = {
        name: await asyncio.create_subprocess_exec(
            sys.executable, __file__, "--read", name, str(port), str(frames), stdout=asyncio.subprocess.PIPE
        )
        for name in readers
    }
    outputs = {name: asyncio.create_task(child.communicate()) for name, child in children.items()}
    sent: dict[int, float] = {}
    try:
        async with asyncio.timeout(seconds + 20.0):
            await publish(server, rate, bodies, sent, lambda: all(task.done() for task in outputs.values()))
    finally:
        for child in children.values():
            if child.returncode is None:
                child.kill()
        await server.close()
    return {name: summary(json.loads(outputs[name].result()[0]), sent, rate) for name in readers}


async def publish(
    server: DataStreamServer, rate: float, bodies: int, sent: dict[int, float], done: Callable[[], bool]
) -> None:
    """Publish frame after frame at `rate` (Hz) and note in `sent` when each went out."""
    others = tuple(
        SeenBody(f"body{i}", TruePose((1.0 + i, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)), 1.0)
        for i in range(bodies - 1)
    )
    start, number = time.monotonic(), 0
    while not done():
        number += 1
        await asyncio.sleep(max(0.0, start + number / rate - time.monotonic()))
        beacon = SeenBody("beacon", TruePose((number / 1000.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)), 1.0)
        frame = CameraFrame(number, start + number / rate, (beacon, *others))
        sent[number] = time.monotonic()
        server.publish(frame, 0.0)


def summary(received: list[tuple[int, float]], sent: dict[int, float], rate: float) -> dict[str, float | int]:
    """Latency percentiles (s), from before the frame is encoded to the pose in hand, and frames lost."""
    steady = received[int(WARM_UP_S * rate) :]
    delays = np.array([moment - sent[number] for number, moment in steady])
    p50, p90, p99 = np.percentile(delays, [50, 90, 99])
    return {
        "frames": len(steady),
        "lost": steady[-1][0] - steady[0][0] + 1 - len(steady),
        "latency_p50": float(p50),
        "latency_p90": float(p90),
        "latency_p99": float(p99),
        "latency_max": float(delays.max()),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--bodies", type=int, default=2)
    parser.add_argument("--read", nargs=3, metavar=("READER", "PORT", "FRAMES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.read:
        name, port, frames = options.read
        print(json.dumps(READERS[name](int(port), int(frames))))
        return
    readers = [name for name in READERS if importlib.util.find_spec(name) is not None]
    result = {
        "benchmark": "mocap_latency",
        "rate_hz": options.rate,
        "bodies": options.bodies,
        "seconds": options.seconds,
        "unit": "s",
        "machine": {"cpus": os.cpu_count(), "python": platform.python_version(), "load": os.getloadavg()[0]},
        "clients": asyncio.run(measure(options.rate, options.seconds, options.bodies, readers)),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
