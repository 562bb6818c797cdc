"""A simulated Crazyflie that any CRTP client can connect to."""
