"""Gates G2 and G3: `motioncapture` 1.1 (it contains Vicon's SDK) reads our server; our client agrees."""

import importlib.util
import json
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocap_bridge.pose import open_pose_stream
from mocap_bridge.rotation import angle_between, normalised
from sim_backend.room.cameras import SeenBody
from sim_backend.room.feed import TruePose
from tests.mocap.frame_publisher import FramePublisher
from tests.patience import PATIENCE_S

READER = Path(__file__).with_name("motioncapture_reader.py")
RATE_HZ = 220.0
FRAMES = 560
COUNT = 4000

RNG = np.random.default_rng(2022)
POSITIONS = RNG.uniform(-3.0, 3.0, size=(COUNT, 3))
QUATERNIONS = Rotation.random(COUNT, random_state=7).as_quat()
OCCLUDED = RNG.random(COUNT) < 0.2


def bodies(number: int) -> tuple[SeenBody, ...]:
    """A beacon whose x tells the frame number (mm), and a body anywhere, a fifth of the time unseen."""
    beacon = TruePose((number / 1000.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0))
    i = number % COUNT
    pose = None if OCCLUDED[i] else TruePose(tuple(POSITIONS[i].tolist()), tuple(QUATERNIONS[i].tolist()))
    return (SeenBody("beacon", beacon, 1.0), SeenBody("cf1", pose, 0.9))


def read_with_motioncapture(port: int) -> list[dict]:
    command = [sys.executable, str(READER), f"127.0.0.1:{port}", str(FRAMES)]
    child = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return [json.loads(line)["bodies"] for line in child.stdout.splitlines()]


@pytest.mark.skipif(
    importlib.util.find_spec("motioncapture") is None, reason="motioncapture has no wheel for this platform"
)
def test_motioncapture_and_our_client_both_get_what_our_server_sends():
    with FramePublisher(bodies, RATE_HZ) as publisher:
        uri = f"vicon://127.0.0.1:{publisher.port}?subject=cf1"
        with open_pose_stream(uri) as stream, ThreadPoolExecutor(1) as pool:
            # Ours begins before theirs and ends after.
            reading = pool.submit(read_with_motioncapture, publisher.port)
            samples = [stream.read(PATIENCE_S)]
            while not reading.done():
                samples.append(stream.read(PATIENCE_S))
            theirs = reading.result()
    ours = {sample.frame - 1: sample for sample in samples}

    compared = absent = 0
    for frame in theirs:
        if "beacon" not in frame:
            continue
        number = round(frame["beacon"][0] * 1000.0)
        i = number % COUNT
        # G3: both clients saw the same frame.
        assert (ours[number].position is None) == ("cf1" not in frame) == bool(OCCLUDED[i])
        if "cf1" not in frame:
            absent += 1
            continue
        compared += 1
        position, quaternion = frame["cf1"][:3], normalised(tuple(frame["cf1"][3:]))
        assert math.dist(position, POSITIONS[i]) <= 1e-6
        assert angle_between(quaternion, tuple(QUATERNIONS[i])) <= 1e-6
        assert math.dist(ours[number].position, POSITIONS[i]) <= 1e-12
        assert angle_between(ours[number].quaternion, tuple(QUATERNIONS[i])) <= 1e-7
        assert math.dist(ours[number].position, position) <= 1e-6
    assert compared + absent >= 500
    assert absent >= 50
    numbers = sorted(ours)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "our client lost frames"
