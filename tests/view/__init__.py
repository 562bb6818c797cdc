"""The view of a flight."""
