"""``perchhw mocap calibrate``: the room is measured, not typed."""
