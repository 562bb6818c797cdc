"""The instruments of the bench: serial devices, supplies, a person, and the drone itself.

The only package that imports pyserial. Every driver is a context manager, reads with deadlines of at most
1 s, raises :class:`~calibration.bench.instruments.errors.InstrumentError` in the operator's words, and counts
what it had to throw away. ``docs/bench_instruments.md`` has wiring and line protocol.
"""
