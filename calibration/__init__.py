"""Measure the real vehicle, and make the model agree with it."""
