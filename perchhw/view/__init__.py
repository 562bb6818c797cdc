"""Views of a flight in Rerun."""
