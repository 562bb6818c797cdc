"""The record of a run: its topics, its writer, its reader. Format: ``docs/records.md``.

Flight writes it, analysis reads it, and a mocap source plays its poses.
"""
