"""Child process: a motion-capture program that sends its poses by MAVSDK. Usage: mavsdk_mocap.py PORT KIND.

KIND is odometry, vision or mocap; the pose is the same all the time: 1, 2, -3 m north, east, down, turned by
roll 0.2, pitch -0.3 and yaw 0.4 rad.
"""

import math
import sys
import time

from mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mocap import (
    AngleBody,
    AttitudePositionMocap,
    Covariance,
    Mocap,
    Odometry,
    PositionBody,
    Quaternion,
    VisionPositionEstimate,
)
from pymavlink.quaternion import Quaternion as EulerQuaternion

ROLL, PITCH, YAW = 0.2, -0.3, 0.4
UNKNOWN = Covariance([math.nan])


def main(port: int, kind: str) -> None:
    with Mavsdk(Configuration.create_manual(42, 197, True)) as sdk:
        sdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        mocap = Mocap(sdk.first_autopilot(60.0))
        place = PositionBody(1.0, 2.0, -3.0)
        w, x, y, z = EulerQuaternion([ROLL, PITCH, YAW]).q
        turned = Quaternion(float(w), float(x), float(y), float(z))
        while True:
            now = time.monotonic_ns() // 1000
            if kind == "vision":
                angles = AngleBody(ROLL, PITCH, YAW)
                mocap.set_vision_position_estimate(VisionPositionEstimate(now, place, angles, UNKNOWN, 0))
            elif kind == "mocap":
                mocap.set_attitude_position_mocap(AttitudePositionMocap(now, turned, place, UNKNOWN))
            else:
                odometry = Odometry(now, Odometry.MavFrame.LOCAL_FRD, place, turned)
                odometry.pose_covariance = odometry.velocity_covariance = UNKNOWN
                mocap.set_odometry(odometry)
            time.sleep(0.01)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
