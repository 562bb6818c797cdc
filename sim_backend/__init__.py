"""The world: physics, a simulated Crazyflie, a simulated motion-capture room, simulated bench instruments."""
