"""Thrust against motor voltage: tables, forms, their choice, battery compensation.

:func:`~calibration.bench.thrust.analysis.read_table` and `analyse` there are the whole way from a file to a
result; docs/bench_thrust.md tells the physics. Everything here is pure: files in, numbers and findings out.
"""
