"""A whole attempt in lock step is the same again, beside busy processes."""

import pytest

from tests.lab_time.same_flight import same

pytestmark = pytest.mark.soak


def test_a_flight_beside_busy_processes_is_the_same_flight() -> None:
    compared = same(seed=1, busy=3, count=1)
    assert compared["quiet"] == compared["loaded"]
    assert compared["quiet"][0]["aborted_by"] is None
    assert compared["quiet"][0]["armed_at"] % 2.0 < 0.021, "a look of the supervisor after its slot"
