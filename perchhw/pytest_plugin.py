"""pytest plugin of perchhw: simulated Crazyflies and rooms as fixtures for any project."""
