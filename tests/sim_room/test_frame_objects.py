"""A frame of the room as objects of the DataStream protocol."""

from hypothesis import example, given
from hypothesis import strategies as st

from mocap_bridge.datastream.objects import TIMECODE_PAL_HZ, Timecode
from sim_backend.room.cameras import CameraFrame
from sim_backend.room.frame_objects import frame_objects


def timecode(number: int, rate_hz: float) -> Timecode:
    objects = frame_objects(CameraFrame(number, 0.0, ()), rate_hz, 0.0)
    (found,) = (item for item in objects if isinstance(item, Timecode))
    return found


@given(
    number=st.integers(0, 10**6),
    rate_hz=st.one_of(st.integers(1, 2000).map(float), st.floats(1.0, 2000.0)),
)
@example(number=748, rate_hz=220.0)
def test_every_frame_has_a_timecode_of_its_own_in_their_order(number: int, rate_hz: float) -> None:
    """Also where rate over 25 Hz is no number that a float has: 748 frames at 220 Hz are 85 times 8.8."""
    before, after = timecode(number, rate_hz), timecode(number + 1, rate_hz)
    for code in (before, after):
        assert 0 <= code.subframe < code.subframes_per_frame
        assert code.frames < TIMECODE_PAL_HZ
    assert before[:5] < after[:5] or after[:5] == (0, 0, 0, 0, 0), "a day later it begins anew"
