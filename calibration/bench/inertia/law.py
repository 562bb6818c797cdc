"""The rate of a damped pendulum in closed form, for fits.

A bifilar pendulum with equal, parallel strings obeys ``a'' = -w0^2 sin a - 2 c a' - d |a'| a'`` (a: angle).
Without damping its rate is a Jacobi function whose Fourier series (DLMF 22.11.2, 20.2) reads, with the square
root ``s`` of the nome,

    a' = 8 w sum_n s^(2n+1) / (1 + s^(4n+2)) cos((2n+1) phi),   w = phi' = w0 / (1 + 2 s^2)^2 (to s^8),

and the amplitude A obeys ``sin(A/2) = 4 s ((1 + s^4) / (1 + 2 s^2))^2``, so that s is about A/8. Damping lets
s fall slowly: averaged over a cycle, the root of the action, ``b = s / ((1 + s^2) (1 + 2 s^2))``, obeys
``b' = -c b - q b^2``, which has a closed form.
"""

import math
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray

_CELLS = 48  # of the quadrature of the phase; its error is below 1e-7 cycles


@dataclass(frozen=True, slots=True)
class PendulumSwing:
    """Parameters of one swing, time counted from its first sample.

    Attributes:
        omega: rad/s, frequency at zero amplitude without damping.
        root: b at the start, see the module (about an eighth of the amplitude in rad).
        phase: rad, of the rate at the start.
        linear: 1/s, c.
        quadratic: 1/s, q, decay rate of b per b by the drag.
    """

    omega: float
    root: float
    phase: float
    linear: float
    quadratic: float

    def roots(self, time: FloatArray) -> FloatArray:
        """s at `time` (s)."""
        run = time if abs(self.linear) < 1e-9 else -np.expm1(-self.linear * time) / self.linear
        b = self.root * np.exp(-self.linear * time) / (1.0 + self.quadratic * self.root * run)
        return np.asarray(b * (1.0 + 3.0 * b * b))

    def rate(self, time: FloatArray) -> FloatArray:
        """The turn rate, rad/s, at `time` (s), which starts at about zero."""
        s = self.roots(time)
        first = np.cos(self._phase(time))
        third = first * (4.0 * first * first - 3.0)
        s2 = s * s
        wave = s * (first / (1.0 + s2) + s2 * third)  # the fifth is below 1e-6 of the first at 25 deg
        return np.asarray(8.0 * self._frequency(s) * wave)

    def amplitude(self, time: FloatArray) -> FloatArray:
        """Largest angle of the cycle around `time` (s), rad."""
        s = self.roots(time)
        return np.asarray(2.0 * np.arcsin(4.0 * s * ((1.0 + s**4) / (1.0 + 2.0 * s**2)) ** 2))

    def cycles(self, span: float) -> float:
        """How many cycles pass in `span` (s)."""
        ends = self._phase(np.array([0.0, span]))
        return float(ends[1] - ends[0]) / math.tau

    def damping_ratio(self, span: float) -> float:
        """Mean damping over `span` (s) as a share of the critical one."""
        ends = self.amplitude(np.array([0.0, span]))
        return float(math.log(ends[0] / ends[1]) / (self.omega * span))

    def _frequency(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.omega / (1.0 + 2.0 * s * s) ** 2)

    def _phase(self, time: FloatArray) -> FloatArray:
        """Integral of the frequency: Simpson's rule per cell, cubic in between."""
        edges = np.linspace(0.0, max(float(time[-1]), 1e-9), 2 * _CELLS + 1)
        speed = np.sqrt(np.maximum(self._frequency(self.roots(edges)) ** 2 - self.linear**2, 0.0))
        width = edges[2] - edges[0]
        cells = width / 6.0 * (speed[:-2:2] + 4.0 * speed[1:-1:2] + speed[2::2])
        at_edge = np.concatenate([[0.0], np.cumsum(cells)])
        cell = np.minimum((time / width).astype(np.intp), _CELLS - 1)
        u = time / width - cell
        left, right = speed[0:-2:2][cell] * width, speed[2::2][cell] * width
        rise = at_edge[cell + 1] - at_edge[cell]
        cubic = u * (left + u * (3.0 * rise - 2.0 * left - right + u * (left + right - 2.0 * rise)))
        return np.asarray(self.phase + at_edge[cell] + cubic)
