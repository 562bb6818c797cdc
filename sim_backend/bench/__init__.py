"""The simulated bench: pendulum, motor stand, scale and supply, with the person who uses them."""
