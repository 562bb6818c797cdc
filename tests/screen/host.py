"""A host with a screen and invented flights: ``python -m tests.screen.host FOLDER SCENE``.

Scenes: ``fly``; ``raise``, an error of ours while the file of that name is there; ``interrupted``, as by the
operator, when the first flight has ended.

What happens goes as JSON lines to ``FOLDER/told``: the terminal is the screen's.
"""

import json
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

from mocap_bridge.health import PoseVerdict
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.record import RunRecorder
from perchhw.screen.display import Progress
from perchhw.screen.flight_display import flight_display
from perchhw.supervisor import FlightState, Observation, Phase

TICK = 0.02
SEEN = Observation(
    link_silence=0.01,
    pose_verdict=PoseVerdict.OK,
    pose_age=0.01,
    pose_position=(0.0, 0.0, 0.5),
    estimate_age=0.01,
    estimate_position=(0.0, 0.0, 0.52),
    estimate_velocity=(0.0, 0.0, 0.0),
    battery_voltage=3.92,
    active_policy_crc=0x1A2B3C4D,
)


def main() -> None:
    folder, scene = Path(sys.argv[1]), sys.argv[2]
    lock = threading.Lock()

    def tell(**what: object) -> None:
        with lock, (folder / "told").open("a") as stream:
            stream.write(json.dumps({"at": time.monotonic(), **what}) + "\n")

    with flight_display("campaign trial", "udp://127.0.0.1:1") as display:
        for number in (1, 2):
            display.progress(Progress(attempts=2, outcomes=(("four_leg", 1),) if number > 1 else ()))
            display.between()
            if number > 1:
                display.confirm("Take the drone off the ceiling")
            record = folder / f"run{number}"
            display.begin(record, "2.5 m/s, 50 deg", number)
            with RunRecorder(record, {}) as recorder, OperatorInterrupts() as interrupts:
                interrupts.stop_by(lambda: tell(stopped=True))
                state = FlightState(
                    phase=Phase.CHECKING, entered_at=recorder._clock(), waiting_for="the checks"
                )
                display.phase(state)
                tell(began=number)
                longest, last, shown = 0.0, time.monotonic(), interrupts.count
                while interrupts.count < 2 and not (folder / f"end{number}").exists():
                    state = replace(state, time=recorder._clock())
                    display.look(state, SEEN)
                    display.write("pose", state.time, {})
                    display.write("estimate", state.time, {})
                    time.sleep(TICK)
                    now = time.monotonic()
                    longest, last = max(longest, now - last), now
                    if interrupts.count != shown:
                        shown = interrupts.count
                        tell(count=shown)
                        state = replace(state, phase=Phase.LANDING, entered_at=state.time, alert="KEEP AWAY")
                        display.phase(state)
                    if scene == "raise" and (folder / "raise").exists():
                        raise RuntimeError("an error of ours")
                tell(ended=number, longest=longest)
            if scene == "interrupted":
                raise KeyboardInterrupt


if __name__ == "__main__":
    main()
