"""Rehearsals on the desk: the drone computes an approach, and the reference judges what it computed."""
