"""The drone: what it knows and computes, and the one door to it."""
