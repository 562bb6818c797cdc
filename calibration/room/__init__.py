"""The room is measured, not typed: where the body sits in its markers, and where the ceiling is."""
