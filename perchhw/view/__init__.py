"""Views of a flight in Rerun."""

from perchhw.view.rerun_recording import ViewError, open_in_viewer, write_rrd

__all__ = ["ViewError", "open_in_viewer", "write_rrd"]
