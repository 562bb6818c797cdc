"""What one recording says: its period at zero amplitude, and all that checks and report look at."""

from dataclasses import dataclass, field
from typing import Literal

from calibration.bench.inertia.envelope import Envelope
from calibration.measurement import Estimate, Finding, rejected
from onboard.arrays import FloatArray, Vector


@dataclass(frozen=True, slots=True, eq=False)
class SwingFit:
    """What one recording says.

    Attributes:
        source: name of the recording.
        clock: who stamped it.
        axis: unit vector, body frame, about which it turned; its largest component is positive.
        off_axis: rad between `axis` and the body axis that the operator says hangs vertical, or None.
        cross: rates about other axes over those about `axis` (second over first singular value).
        period: s, at zero amplitude without damping; its sigma is that of the fit alone, which is 10 to 40
            times smaller than the spread between trials.
        crossing_period: s, the same from zero crossings and local amplitudes, or None if too few.
        sine_period: s, of a damped sine, which ignores the amplitude.
        start_amplitude: rad. end_amplitude: rad.
        cycles: that were recorded.
        largest_gap: s between two samples.
        loss: share of samples lost, or None where the host stamped.
        damping_ratio: mean over the recording.
        swing_share: amplitude of the strongest other line over that of the torsion.
        swing_frequency: Hz of that line.
        second_mode: whether it was fitted with the torsion.
        residual_share: rms of what the fit leaves over the mean amplitude of the rate.
        mean_square_amplitude: rad2, as it acts on the period of the whole recording.
        time: s from the first sample, (n,). rate: rad/s about `axis`, (n,). fitted: the same, of the fit.
        envelope: local amplitude of the torsion.
        findings: of all checks.
    """

    source: str
    clock: Literal["drone", "host"]
    axis: Vector
    off_axis: float | None
    cross: float
    period: Estimate
    crossing_period: float | None
    sine_period: float
    start_amplitude: float
    end_amplitude: float
    cycles: float
    largest_gap: float
    loss: float | None
    damping_ratio: float
    swing_share: float
    swing_frequency: float
    second_mode: bool
    residual_share: float
    mean_square_amplitude: float
    time: FloatArray = field(repr=False)
    rate: FloatArray = field(repr=False)
    fitted: FloatArray = field(repr=False)
    envelope: Envelope = field(repr=False)
    findings: tuple[Finding, ...] = ()

    @property
    def rejected(self) -> bool:
        """Whether a finding says that this recording must not count."""
        return rejected(self.findings)
