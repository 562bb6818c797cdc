import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocap_bridge.rotation import angle_between
from onboard.errors import InputError
from sim_backend.fault_values import FaultError, FaultWindow
from sim_backend.room.cameras import Cameras
from sim_backend.room.feed import TruePose
from sim_backend.room.markers import LAYOUT
from sim_backend.room.settings import RoomFaults, RoomSettings, RoomSettingsError

BODIES = {"cf1": TruePose((1.0, 2.0, 1.5), (0.0, 0.0, 0.0, 1.0))}


def expose_at(world_times, faults=None, **settings):
    cameras = Cameras(RoomSettings(faults=faults or RoomFaults(), **settings), np.random.default_rng(4))
    return [cameras.expose(i, t, BODIES, t).bodies[0] for i, t in enumerate(world_times)]


def test_static_noise_is_that_of_a_real_room():
    seen = expose_at(np.arange(3000) * 0.01)
    positions = np.array([body.pose.position for body in seen])
    assert positions.std(axis=0) == pytest.approx([17e-6] * 3, rel=0.1)
    angles = [angle_between(body.pose.quaternion, (0.0, 0.0, 0.0, 1.0)) for body in seen]
    assert np.sqrt(np.mean(np.square(angles)) / 3.0) == pytest.approx(0.2e-3, rel=0.1)
    # A live body never repeats exactly.
    assert len({tuple(position) for position in positions}) == len(positions)


def test_same_seed_same_frames():
    assert expose_at([0.0, 0.01, 0.02]) == expose_at([0.0, 0.01, 0.02])


def test_freeze_repeats_to_the_bit_and_ends():
    seen = expose_at([0.98, 0.99, 1.0, 1.01, 1.09, 1.1], RoomFaults(freeze=FaultWindow(1.0, 1.1)))
    assert seen[1] == seen[2] == seen[3] == seen[4]
    assert seen[5] != seen[4]


def test_occlusion_and_flip_by_world_time():
    seen = expose_at([0.5, 1.0, 1.5], RoomFaults(occlude=FaultWindow(1.0, 1.2)))
    assert [body.pose is None for body in seen] == [False, True, False]
    seen = expose_at([0.5, 1.0, 1.5], RoomFaults(flip180=FaultWindow(1.0, 1.01)))
    angles = [angle_between(body.pose.quaternion, (0.0, 0.0, 0.0, 1.0)) for body in seen]
    assert angles == pytest.approx([0.0, math.pi, 0.0], abs=2e-3)


def test_random_occlusion_has_its_probability():
    seen = expose_at(np.arange(2000) * 0.01, occlusion=0.2)
    assert sum(body.pose is None for body in seen) == pytest.approx(400, abs=60)


def test_unknown_bodies_are_not_seen_and_missing_ones_are_occluded():
    cameras = Cameras(RoomSettings(subjects=("cf1", "cf2")), np.random.default_rng(4))
    frame = cameras.expose(1, 0.0, BODIES | {"ghost": BODIES["cf1"]}, 0.0)
    assert [(body.name, body.pose is None) for body in frame.bodies] == [("cf1", False), ("cf2", True)]


def test_a_body_whose_fit_fails_leaves_its_markers_and_a_hidden_one_nothing():
    """What a client fits to these markers is the body."""
    pose = TruePose((1.0, 2.0, 0.5), (0.0, 0.0, 0.6, 0.8))
    failing = Cameras(RoomSettings(occlusion=1.0), np.random.default_rng(4))
    frame = failing.expose(1, 0.0, {"cf1": pose}, 0.0)
    assert frame.bodies[0].pose is None
    turned, distance = Rotation.align_vectors(np.array(frame.unlabelled) - pose.position, LAYOUT)
    assert distance < 1e-12
    np.testing.assert_allclose(turned.as_quat(), pose.quaternion, atol=1e-12)
    hidden = RoomFaults(occlude=FaultWindow(0.0, 1.0), reflections=3)
    frame = Cameras(RoomSettings(faults=hidden), np.random.default_rng(4)).expose(1, 0.0, {"cf1": pose}, 0.5)
    assert len(frame.unlabelled) == 3
    assert all(height == 0.01 for _, _, height in frame.unlabelled)


def test_no_two_distances_of_the_markers_are_alike():
    distances = sorted(math.dist(a, b) for a, b in combinations(LAYOUT, 2))
    assert min(far - near for near, far in pairwise(distances)) > 5e-4


def test_faults_by_their_names():
    faults = RoomFaults.parse(
        {
            "mocap_freeze_at": "3.5",
            "mocap_occlude_at": "2:0.5",
            "mocap_flip180_at": "4",
            "mocap_drop": "0.1",
            "mocap_jitter_ms": "20",
            "mocap_dies_at": "9",
            "mocap_reflections": "2",
        }
    )
    assert faults == RoomFaults(
        FaultWindow(3.5), FaultWindow(2.0, 2.5), FaultWindow(4.0, 4.01), 0.1, 0.02, 9.0, 2
    )
    assert RoomFaults.parse({}) == RoomFaults()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mocap_freezes_at", "1"),
        ("mocap_freeze_at", "soon"),
        ("mocap_freeze_at", "1:"),
        ("mocap_occlude_at", "1:x"),
        ("mocap_drop", "1.5"),
        ("mocap_drop", "-0.1"),
        ("mocap_jitter_ms", "nan"),
        ("mocap_dies_at", "inf"),
    ],
)
def test_faults_that_cannot_be_used_are_input_errors(name: str, value: str):
    with pytest.raises(FaultError, match=name) as caught:
        RoomFaults.parse({name: value})
    assert isinstance(caught.value, InputError)


@pytest.mark.parametrize(
    "settings", [{"rate_hz": 0.0}, {"subjects": ("a", "a")}, {"subjects": ("",)}, {"subjects": ("n" * 24,)}]
)
def test_settings_that_cannot_be_used_are_refused(settings):
    with pytest.raises(RoomSettingsError):
        RoomSettings(**settings)
