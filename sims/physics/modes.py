"""Linear differential equations with constant coefficients, solved by their modes.

x' = A x + u f(t) + w g(t). Here f is a constant and a ramp; g is the laboratory's temperature: a constant, a ramp and
the daily sine. The solution is the particular solution plus a decaying exponential for every eigenvalue of A; both are
computed once for the whole interval.
"""

from __future__ import annotations

from cmath import exp

import numpy as np
from numpy.typing import NDArray

from rig.sims.physics.thermal import OMEGA, Lab

Array = NDArray[np.float64]

_SEPARATION = 1e-6
"""Relative change of the coefficients that separates coinciding eigenvalues; their vectors would be parallel."""


class Response:
    """The state from `start` on.

    Args:
        start: virtual time.
        matrix: (n, n) A; none of its eigenvalues is zero.
        command: (n,) u.
        surroundings: (n,) w.
        setpoint: f at `start`, and its slope per second.
        lab: g.
        begin: (n,) state at `start`; None for the steady state.
    """

    def __init__(
        self,
        start: float,
        matrix: Array,
        command: Array,
        surroundings: Array,
        setpoint: tuple[float, float],
        lab: Lab,
        begin: Array | None,
    ) -> None:
        self.start = start
        slope = command * setpoint[1] + surroundings * lab.slope
        constant = command * setpoint[0] + surroundings * (lab.mean + lab.slope * start)
        self._slope = -np.linalg.solve(matrix, slope)
        self._constant = np.linalg.solve(matrix, self._slope - constant)
        swing = np.linalg.solve(1j * OMEGA * np.eye(len(matrix)) - matrix, surroundings * lab.amplitude)
        self._swing = swing * np.exp(1j * lab.phase)
        rates, vectors = _modes(matrix)
        self._rates = [complex(r) for r in rates]
        driven = self._constant + (self._swing * exp(1j * OMEGA * start)).imag
        away = np.zeros_like(driven) if begin is None else begin - driven
        self._transients = vectors * np.linalg.solve(vectors, away)
        self._rows = [
            (float(c), float(s), complex(w), [complex(v) for v in row])
            for c, s, w, row in zip(self._constant, self._slope, self._swing, self._transients, strict=True)
        ]

    def at(self, index: int, t: float) -> float:
        """One component of the state at `t`."""
        constant, slope, swing, transients = self._rows[index]
        gone = t - self.start
        value = constant + slope * gone + (swing * exp(1j * OMEGA * t)).imag
        for amplitude, rate in zip(transients, self._rates, strict=True):
            value += (amplitude * exp(rate * gone)).real
        return value

    def state(self, t: float) -> Array:
        """(n,) the whole state at `t`."""
        return np.array([self.at(i, t) for i in range(len(self._rows))])


def _modes(matrix: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    rates, vectors = np.linalg.eig(matrix)
    if np.linalg.cond(vectors) > 1.0 / _SEPARATION:
        apart = 1.0 + _SEPARATION * np.arange(1, len(matrix) + 1)
        rates, vectors = np.linalg.eig(matrix * apart[:, np.newaxis])
    return rates.astype(np.complex128), vectors.astype(np.complex128)
