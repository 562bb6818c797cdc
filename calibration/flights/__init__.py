"""Flights from files: one type, one loader per format."""

from calibration.flights.flight import (
    CHANNELS,
    Channel,
    Flight,
    FlightFileError,
    PoseSource,
    Trigger,
    UnusableFlightError,
)
from calibration.flights.formats import FORMATS, UnusableFlight, flight_files, open_flight, open_flights

__all__ = [
    "CHANNELS",
    "FORMATS",
    "Channel",
    "Flight",
    "FlightFileError",
    "PoseSource",
    "Trigger",
    "UnusableFlight",
    "UnusableFlightError",
    "flight_files",
    "open_flight",
    "open_flights",
]
