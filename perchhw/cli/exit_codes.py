"""Exit codes of every verb."""

DONE = 0
FAILED = 1
"""The check failed, or the thing was not achieved."""
USAGE = 2
"""Wrong usage, or input that cannot be used."""
SAFETY = 3
"""A safety rule refused or stopped it."""
INTERRUPTED = 130
"""Interrupted, after cleaning up."""
