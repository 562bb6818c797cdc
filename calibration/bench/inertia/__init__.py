"""Inertia from bifilar swings: recordings, fits, checks, budget, planning, live view, figures."""
