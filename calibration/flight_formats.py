"""Formats of flight files by name: names alone, for the help of a command has to be quick."""

FLIGHT_FORMATS: dict[str, str] = {
    "perchhw": "calibration.flights.perchhw_run.FORMAT",
    "habas": "calibration.flights.habas.FORMAT",
    "table": "calibration.flights.table.FORMAT",
    "nanobench": "calibration.flights.nanobench.FORMAT",
    "usd": "calibration.flights.usd.FORMAT",
}
"""Where each :class:`~calibration.flights.flight_format.FlightFormat` is; they are tried in this order."""
