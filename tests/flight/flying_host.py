"""A host that flies when told, as a process of its own: whoever started it stops, kills or signals it.

It reads one line a flight from standard input, ``FOLDER`` or ``FOLDER HANG_S``, and hovers until it is
stopped, through the real session: link, bridge, supervisor, runner, recorder. In the second form the
supervisor's loop hangs for so long once it hovers. Every change of phase is a line on standard output, and so
is the end of the flight.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

from onboard.errors import PerchhwError
from onboard.room import RoomGeometry
from onboard.timebase import WALL
from perchhw.flight.actions import CommandRunner
from perchhw.flight.readback import TEST_FLIGHT_SETTINGS
from perchhw.flight.recording import FlightRecorder
from perchhw.flight.session import SupervisedFlight
from perchhw.flight.telemetry import TEST_FLIGHT_BLOCKS
from perchhw.record import RunRecorder
from perchhw.supervisor import FlightState, Mission, Phase, SafetyLimits

LIMITS = SafetyLimits(
    room=RoomGeometry(),
    link_silence=5.0,
    pose_age=5.0,
    pose_age_bridged=5.0,
    telemetry_age=5.0,
    battery_age=5.0,
)
"""Old news ends no flight here: it is there to be stopped, at real pace, on a machine that may be busy."""
HOVER = 0.8
"""m; the mission never comes further than the way to a start above it, which takes seconds."""


def say(**what: object) -> None:
    """One line for whoever started this."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def hover(
    drone: str, mocap: str, folder: Path, limits: SafetyLimits, start_x: float, hang_s: float = 0.0
) -> FlightState:
    """Fly until stopped; the supervisor's last state."""

    def on_phase(state: FlightState) -> None:
        say(phase=state.phase.value)
        if state.phase is Phase.MOVING_TO_START:
            time.sleep(hang_s)

    with (
        RunRecorder(folder, {"drone": drone, "mocap": mocap}) as recorder,
        FlightRecorder(recorder) as record,
    ):
        flight = SupervisedFlight(
            drone=drone,
            mocap=mocap,
            mission=Mission(
                policy_crc=0,
                start=(start_x, 0.0, HOVER),
                hover_height=HOVER,
                approach_duration=0.0,
                test_flight=True,
            ),
            limits=limits,
            blocks=TEST_FLIGHT_BLOCKS,
            settings=TEST_FLIGHT_SETTINGS,
            commands=lambda link, events, _readback: CommandRunner(link, events, WALL),
            record=record,
            clock=WALL,
            on_phase=on_phase,
        )
        return flight.run().state


def main() -> None:
    """Fly as often as told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drone", required=True)
    parser.add_argument("--mocap", required=True)
    parser.add_argument("--pose-age", type=float, default=LIMITS.pose_age_bridged, help="limit in flight, s")
    parser.add_argument("--telemetry-age", type=float, default=LIMITS.telemetry_age, help="limit, s")
    parser.add_argument("--start-x", type=float, default=0.0, help="where it moves to, m")
    arguments = parser.parse_args()
    limits = replace(LIMITS, pose_age_bridged=arguments.pose_age, telemetry_age=arguments.telemetry_age)
    say(ready=True)
    for line in sys.stdin:
        folder, *hang = line.split()
        try:
            hang_s = float(hang[0]) if hang else 0.0
            start_x = arguments.start_x
            state = hover(arguments.drone, arguments.mocap, Path(folder), limits, start_x, hang_s)
        except PerchhwError as error:
            say(ended=True, refused=str(error))
        else:
            say(ended=True, phase=state.phase.value, aborted_by=state.aborted_by, alert=state.alert)


if __name__ == "__main__":
    main()
