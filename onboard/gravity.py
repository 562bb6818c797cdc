"""The two numbers called g. They differ by 0.03 %, and each is exact where it belongs."""

GRAVITY = 9.81
"""m/s2, everywhere that something falls or hovers: ``GRAVITY_MAGNITUDE`` of the Crazyflie's firmware, and the
value of the authors' simulation."""

GRAM_FORCE = 9.80665e-3
"""N, the weight of a gram at standard gravity (CGPM, 1901): the unit that thrust is measured in."""
