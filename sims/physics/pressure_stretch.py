"""A first-order system that follows a straight line: one interval of a pressure line, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from math import e, exp, expm1


@dataclass(frozen=True, slots=True)
class Stretch:
    """A lag behind constant + slope * (t - start), from the pressure `begin`, with or without overshoot.

    `bump` is the height of an overshoot; `saturated` means that a valve is fully open without success.
    """

    start: float
    constant: float
    slope: float
    tau: float
    begin: float
    bump: float = 0.0
    saturated: bool = False

    @property
    def fading(self) -> float:
        """Distance from the followed line at its start, psi."""
        return self.begin - self.constant + self.slope * self.tau

    def at(self, t: float) -> float:
        """Pressure, psia."""
        dt = t - self.start
        u = dt / self.tau
        gone = exp(-u)
        return self.constant + self.slope * (dt - self.tau) + (self.fading + self.bump * e * u) * gone

    def rate(self, t: float) -> float:
        """Its slope, psi/s."""
        u = (t - self.start) / self.tau
        return self.slope + (self.bump * e * (1.0 - u) - self.fading) * exp(-u) / self.tau

    def integral(self, t0: float, t1: float) -> float:
        """Integral of the pressure over time, psi s; differences of exponentials are computed without cancellation."""
        d0, length, tau = t0 - self.start, t1 - t0, self.tau
        u0, u1 = d0 / tau, (t1 - self.start) / tau
        straight = self.constant + self.slope * (d0 + length / 2.0 - tau)
        gone = -tau * exp(-u0) * expm1(-length / tau)
        bump = self.bump * e * (gone + tau * (u0 * exp(-u0) - u1 * exp(-u1))) if self.bump else 0.0
        return straight * length + self.fading * gone + bump
