"""Motor dynamics from a tachometer: edge times to speeds, steps, the speed law per direction, its constants.

:func:`~calibration.bench.motors.analysis.analyse` is the whole way from recordings to a result;
docs/bench_motors.md tells the physics. Everything here is pure: files in, numbers and findings out.
"""
