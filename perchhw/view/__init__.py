"""Views of a flight in Rerun, live and recorded: ``docs/view.md``."""
