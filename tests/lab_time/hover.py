"""A short flight over a real link and real poses, in the time of the lab that it flies in."""

import sys
from typing import NamedTuple

from mocap_bridge.bridge import PoseBridge
from onboard.lab_time import open_timebase
from onboard.link import DroneLink, LogSample
from onboard.timebase import Event

POSITION = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")


class Hover(NamedTuple):
    """What came of it: the log samples (receipt time, drone time in ms, x, y, z), and when it began to
    connect, had connected, and ended."""

    samples: list[tuple[float, ...]]
    began: float
    connected: float
    ended: float


def hover(drone: str, mocap: str, *, watched: str = "") -> Hover:
    """Take off, hover, land; when it is `watched` (armed, flying) kick the watchdog once, and wait to die."""
    samples: list[tuple[float, ...]] = []

    def note(sample: LogSample) -> None:
        samples.append((sample.receipt_time, sample.drone_time_ms, *sample.values.values()))

    with open_timebase("hover", drone, mocap) as time:
        began, pause = time(), time.event()
        with DroneLink.open(drone, clock=time) as link, PoseBridge(mocap, link, clock=time):
            connected = time()
            link.stream(POSITION, 10, note)
            pause.wait(1.5)
            if watched == "armed":
                link.kick_emergency_stop_watchdog()
            link.arm()
            if watched == "armed":
                _wait_to_die(pause)
            pause.wait(0.2)
            link.takeoff(0.5, 1.5)
            pause.wait(2.0)
            if watched == "flying":
                link.kick_emergency_stop_watchdog()
                _wait_to_die(pause)
            link.land(0.0, 1.5)
            pause.wait(2.0)
            link.stop_motors()
            link.disarm()
        return Hover(samples, began, connected, time())


def _wait_to_die(pause: Event) -> None:
    sys.stdout.write("watched\n")
    sys.stdout.flush()
    pause.wait(1000.0)


if __name__ == "__main__":
    hover(sys.argv[1], sys.argv[2], watched=sys.argv[3])
