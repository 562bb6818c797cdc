"""Poses in from a motion-capture room, out to a drone."""
