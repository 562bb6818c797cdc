"""How the kernels of the independent landings are compiled."""

from pathlib import Path

from tests.stamped import stamped

jitted = stamped(Path(__file__).parent)
"""Kept on disk until one of the files here changes."""
