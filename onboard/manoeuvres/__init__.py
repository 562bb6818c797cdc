"""Test flights: what each kind asks of a vehicle, sample by sample; docs/gap_flights.md."""

from onboard.manoeuvres.course import Course, CourseBuilder, CourseDoesNotFit, CourseError
from onboard.manoeuvres.library import HOVER, MANOEUVRES, manoeuvre

__all__ = ["HOVER", "MANOEUVRES", "Course", "CourseBuilder", "CourseDoesNotFit", "CourseError", "manoeuvre"]
