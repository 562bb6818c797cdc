"""What the bench measures, made by programs with laws of their own: pendulum, rotor, thrust stand."""
