"""Capture on the bench: from which normal speed on a foot sticks, from a leg that is dropped on the board."""
