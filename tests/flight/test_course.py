"""A test flight that cannot be flown; one that can is in tests/room_calibration."""

from pathlib import Path

import pytest

from onboard.errors import InputError
from perchhw.flight.course import CourseRequest, fly_course


def test_a_flight_that_cannot_be_flown_leaves_no_record(tmp_path: Path) -> None:
    request = CourseRequest(
        kind="loops",
        folder=tmp_path / "run",
        drone="udp://127.0.0.1:9",
        mocap="vicon://127.0.0.1:9?subject=cf1",
        vehicle="crazyflie21-upgraded",
    )
    with pytest.raises(InputError, match="not a kind of test flight"):
        fly_course(request)
    assert not request.folder.exists()
