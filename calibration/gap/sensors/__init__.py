"""Sensing effects from the redundancy of motion capture and inertial sensors; ``docs/gap_data.md``.

Both watch one rigid body: their delay, turn, offset and biases show without a model of the vehicle.
"""

from calibration.gap.sensors.judge import SensingFindings, apply_sensing, judge_sensing, unsaid

__all__ = ["SensingFindings", "apply_sensing", "judge_sensing", "unsaid"]
