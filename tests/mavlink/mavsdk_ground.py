"""Child process: a ground station by MAVSDK, which prints one JSON line for whatever it is told.

Usage: mavsdk_ground.py PORT. Prints ``{"ready": ...}`` when it knows the vehicle; a line ``arm`` on standard
input makes it ask the vehicle to arm and print the answer. Ends with standard input.
"""

import json
import sys
import threading
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.telemetry import Telemetry

_lock = threading.Lock()


def tell(kind: str, **values: Any) -> None:
    with _lock:
        sys.stdout.write(json.dumps({"kind": kind, **values}) + "\n")
        sys.stdout.flush()


def main(port: int) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    with Mavsdk(configuration) as sdk:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        tell("listening")
        vehicle = sdk.first_autopilot(60.0)
        telemetry = Telemetry(vehicle)
        telemetry.subscribe_position_velocity_ned(
            lambda p, *_: tell(
                "position",
                position=[p.position.north_m, p.position.east_m, p.position.down_m],
                velocity=[p.velocity.north_m_s, p.velocity.east_m_s, p.velocity.down_m_s],
            )
        )
        telemetry.subscribe_attitude_quaternion(lambda q, *_: tell("attitude", wxyz=[q.w, q.x, q.y, q.z]))
        telemetry.subscribe_battery(lambda b, *_: tell("battery", volts=b.voltage_v))
        telemetry.subscribe_status_text(lambda s, *_: tell("text", severity=int(s.type), text=s.text))
        telemetry.subscribe_armed(lambda armed, *_: tell("armed", armed=bool(armed)))
        action = Action(vehicle)
        tell("ready")
        for line in sys.stdin:
            if line.strip() == "arm":
                try:
                    action.arm()
                    tell("arm", answer="done")
                except ActionError as error:
                    tell("arm", answer=str(error))


if __name__ == "__main__":
    main(int(sys.argv[1]))
