"""A simulated motion-capture room that any Vicon client can connect to."""
