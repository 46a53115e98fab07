"""The probability that a measured quantity conforms (JCGM 106, clause 7), with and without prior knowledge."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite, lgamma, log, pi, sqrt

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.decision.tolerance import Tolerance
from rig.fitter.errors import FitError

NORMAL_FROM = 1e5
"""Degrees of freedom above which a measurement's distribution is normal."""
_FARTHEST = 40.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_PANELS = 4000


@dataclass(frozen=True, eq=False)
class Prior:
    """Knowledge of a quantity before its measurement, such as the distribution of what a process makes.

    Attributes:
        density: of the quantity, of any shape; need not be normalised.
        lower: end of what is possible, or far enough out that nothing is lost.
        upper: the other end.
        scale: a width over which the density changes little, such as a quarter of its standard deviation.

    """

    density: Callable[[FloatArray], FloatArray]
    lower: float
    upper: float
    scale: float

    def __post_init__(self) -> None:
        if not (isfinite(self.lower) and isfinite(self.upper) and self.lower < self.upper and self.scale > 0.0):
            raise FitError(f"a prior from {self.lower:g} to {self.upper:g}: both ends must be finite, the first below")


def normal_prior(mean: float, sd: float) -> Prior:
    """Normal distribution.

    Raises:
        FitError: `sd` is not positive.

    """
    if not sd > 0.0:
        raise FitError(f"a prior with standard deviation {sd:g}: it must be more than 0")
    return Prior(lambda x: np.exp(-0.5 * np.square((x - mean) / sd)), mean - 36.0 * sd, mean + 36.0 * sd, 0.25 * sd)


def gamma_prior(shape: float, scale: float) -> Prior:
    """Gamma distribution, for a quantity that cannot be negative (JCGM 106, annex B).

    Raises:
        FitError: a parameter is not positive.

    """
    if not (shape > 0.0 and scale > 0.0):
        raise FitError(f"a gamma prior of shape {shape:g} and scale {scale:g}: both must be more than 0")
    farthest = float(special.gammainccinv(shape, 1e-18)) * scale

    def density(x: FloatArray) -> FloatArray:
        return np.exp((shape - 1.0) * np.log(np.maximum(x, 1e-300) / scale) - x / scale)

    return Prior(density, 0.0, farthest, 0.25 * scale * min(sqrt(shape), 1.0))


def conformity_probability(
    value: float, standard_uncertainty: float, tolerance: Tolerance, *, df: float = inf, prior: Prior | None = None
) -> float:
    """Probability that a quantity conforms, given its measured value (JCGM 106, 7.1 to 7.4).

    Without prior knowledge, the quantity has a normal distribution about its measured value, or Student's t with the
    degrees of freedom of its uncertainty. A prior is multiplied with the likelihood of the measured value.

    Args:
        value: measured, in the unit of the tolerance.
        standard_uncertainty: of the value.
        tolerance: interval of conforming values.
        df: effective degrees of freedom of the standard uncertainty.
        prior: knowledge before the measurement.

    Raises:
        FitError: the uncertainty is not positive, or the value is impossible by the prior.

    """
    positive(standard_uncertainty)
    if prior is None:
        ends = (np.array([tolerance.lower, tolerance.upper]) - value) / standard_uncertainty
        # The lower tail of both, mirrored if they lie above: differences of numbers near 1 lose their digits.
        above = bool(ends[0] > 0.0)
        tails = cumulative(-ends if above else ends, df)
        return float(np.clip(abs(tails[1] - tails[0]), 0.0, 1.0))
    x, weights = nodes(prior, [tolerance.lower, tolerance.upper, value], standard_uncertainty)
    joint = weights * prior.density(x) * _density((x - value) / standard_uncertainty, df)
    total = float(np.sum(joint))
    if not total > 0.0:
        raise FitError(
            f"the prior and the measured value {value:g} contradict each other: no value of the quantity is possible "
            "by both. Check the prior, and the unit"
        )
    inside = (x >= tolerance.lower) & (x <= tolerance.upper)
    return float(np.clip(np.sum(joint[inside]) / total, 0.0, 1.0))


def positive(standard_uncertainty: float) -> None:
    """Refuse an uncertainty that is not positive and finite.

    Raises:
        FitError: so it is.

    """
    if not (standard_uncertainty > 0.0 and isfinite(standard_uncertainty)):
        raise FitError(f"a standard uncertainty of {standard_uncertainty:g}: a decision needs one that is more than 0")


def cumulative(z: FloatArray, df: float) -> FloatArray:
    """Distribution function of Student's t, or of the normal distribution."""
    return np.asarray(special.ndtr(z) if df > NORMAL_FROM else special.stdtr(df, z))


def nodes(prior: Prior, points: Sequence[float], standard_uncertainty: float) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of an integral over a prior, with panel edges at the given points.

    Args:
        prior: over its whole range.
        points: where the integrand has steps or is narrow.
        standard_uncertainty: width of the narrow parts.

    """
    edges = {prior.lower, prior.upper}
    for point in points:
        near = np.array([-_FARTHEST, -10.0, 0.0, 10.0, _FARTHEST]) * standard_uncertainty + point
        edges |= {float(edge) for edge in near if prior.lower < edge < prior.upper}
    ordered = sorted(edges)
    panels = []
    for a, b in pairwise(ordered):
        wide = min(prior.scale, 2.0 * standard_uncertainty)
        count = int(min(max(np.ceil((b - a) / wide), 1), _PANELS))
        cut = np.linspace(a, b, count + 1)
        panels.append(np.stack([cut[:-1], cut[1:]]))
    lower, upper = np.concatenate(panels, axis=1)
    half, middle = 0.5 * (upper - lower), 0.5 * (upper + lower)
    return (middle[:, None] + half[:, None] * _NODES).ravel(), (half[:, None] * _WEIGHTS).ravel()


def _density(z: FloatArray, df: float) -> FloatArray:
    if df > NORMAL_FROM:
        return np.exp(-0.5 * np.square(z)) / sqrt(2.0 * pi)
    constant = lgamma(0.5 * (df + 1.0)) - lgamma(0.5 * df) - 0.5 * log(df * pi)
    return np.exp(constant - 0.5 * (df + 1.0) * np.log1p(np.square(z) / df))
