"""A search says how long the rest takes, once it knows."""

from calibration.gap.search.selection import TimeToGo


def test_time_to_go_is_that_of_what_is_left_at_the_pace_so_far() -> None:
    times = iter([100.0, 160.0, 170.0])  # the first took a minute, the second 10 s
    pace = TimeToGo(lambda: next(times))
    told = [pace.to_go(3), pace.to_go(2), pace.to_go(1)]
    assert told == ["", " (about 120 s to go)", " (about 35 s to go)"]
