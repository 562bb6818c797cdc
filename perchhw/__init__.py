"""Fly: supervisor, campaigns, learning, records, reports, live view, command line."""
