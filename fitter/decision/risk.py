"""Global risks of a decision rule over all items of a population (JCGM 106, 9.4 and 9.5)."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.decision.probability import Prior, cumulative, nodes, positive
from rig.fitter.decision.tolerance import Tolerance
from rig.fitter.errors import FitError


@dataclass(frozen=True)
class Risks:
    """Shares of all items that a rule judges.

    Attributes:
        consumer: accepted, and do not conform (global consumer's risk).
        producer: rejected, and conform (global producer's risk).
        accepted: of all items.
        conforming: of all items.

    """

    consumer: float
    producer: float
    accepted: float
    conforming: float

    @property
    def consumer_of_accepted(self) -> float:
        """Share of accepted items that do not conform; NaN if none is accepted."""
        return self.consumer / self.accepted if self.accepted > 0.0 else float("nan")


def global_risks(
    prior: Prior, standard_uncertainty: float, tolerance: Tolerance, acceptance: Tolerance | None, *, df: float = inf
) -> Risks:
    """Risks before any item is measured.

    Args:
        prior: distribution of the items.
        standard_uncertainty: of the measuring system.
        tolerance: interval of conforming values.
        acceptance: interval of accepted measured values; None accepts nothing.
        df: degrees of freedom of the measuring system's uncertainty.

    Raises:
        FitError: the uncertainty is not positive.

    """
    positive(standard_uncertainty)
    ends = [tolerance.lower, tolerance.upper]
    ends += [] if acceptance is None else [acceptance.lower, acceptance.upper]
    x, weights = nodes(prior, [end for end in ends if np.isfinite(end)], standard_uncertainty)
    items = weights * prior.density(x)
    items = items / np.sum(items)
    inside = (x >= tolerance.lower) & (x <= tolerance.upper)
    accepted, rejected = _accepted(x, acceptance, standard_uncertainty, df)
    return Risks(
        float(np.sum((items * accepted)[~inside])),
        float(np.sum((items * rejected)[inside])),
        float(np.sum(items * accepted)),
        float(np.sum(items[inside])),
    )


def _accepted(x: FloatArray, acceptance: Tolerance | None, u: float, df: float) -> tuple[FloatArray, FloatArray]:
    """Probabilities that items are accepted and rejected, each without loss of digits."""
    if acceptance is None:
        return np.zeros_like(x), np.ones_like(x)
    below, above = (acceptance.lower - x) / u, (x - acceptance.upper) / u
    rejected = cumulative(below, df) + cumulative(above, df)
    # The difference of the two small tails where both limits lie on one side.
    accepted = np.where(
        below > 0.0,
        cumulative(-below, df) - cumulative(above, df),
        cumulative(-above, df) - cumulative(below, df),
    )
    return accepted, rejected


def guard_band_for(risk: float, prior: Prior, standard_uncertainty: float, tolerance: Tolerance) -> float:
    """Guard band with which the global consumer's risk is as wanted; negative if it may lie outside the tolerance.

    Raises:
        FitError: no guard band within ten standard uncertainties has this risk.

    """

    def excess(guard: float) -> float:
        narrow = tolerance.narrowed(guard)
        return global_risks(prior, standard_uncertainty, tolerance, narrow).consumer - risk

    low, high = -10.0 * standard_uncertainty, min(10.0 * standard_uncertainty, 0.5 * tolerance.width)
    if excess(low) < 0.0 or excess(high) > 0.0:
        raise FitError(f"no guard band within ten standard uncertainties has a global consumer's risk of {risk:g}")
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)
