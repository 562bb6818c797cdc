"""Lab files to test with."""

from onboard.bounds import Bounds

RULES = {
    "battery_at_rest": Bounds("V", 3.8, 4.1, "a pack of less sags"),
    "tilt_in_hover": Bounds("rad", 0.25, 0.8, "moves need less"),
}

LAB = """
schema = "perchhw.lab/1"

[room]
x_min = -3.0
x_max = { value = 150, unit = "cm", sigma = 1, source = "tape measure, 2025-03-04" }
y_min = -1
y_max = 1.2
ceiling = { height = 2.4, tilt_x_deg = 1.0 }
start = { x = -2.0, y = 0.1, yaw_deg = 2 }

[[drones]]
uri = "udp://127.0.0.1:19850?time=shm"
vehicle = "crazyflie21-upgraded"

[mocap]
uri = "vicon://127.0.0.1:18801"
subject = "cf1"
"""
