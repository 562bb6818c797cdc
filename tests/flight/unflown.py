"""An attempt for tests that plan or compare, and fly nothing."""

from pathlib import Path

from perchhw.attempt import AttemptRequest

REQUEST = AttemptRequest(
    speed=2.5,
    angle_deg=50.0,
    index=0,
    folder=Path("unused"),
    drone="udp://127.0.0.1:9",
    mocap="vicon://127.0.0.1:9?subject=cf1",
    policy="default",
    vehicle="crazyflie21-upgraded",
)
