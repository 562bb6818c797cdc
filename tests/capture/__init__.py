"""Pads on the bench."""
