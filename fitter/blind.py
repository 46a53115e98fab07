"""Cases in which the test of lack of fit is insensitive: its denominator contains more than scatter.

The denominator of T_bias is the scatter of readings at one point. It also contains drift between replications and
random walk within them, so a smaller lack of fit is not significant. Drift of the parameters between replications can
be removed: lack of fit is then tested against the scatter beyond each replication's own parameters. A random walk
within replications cannot be removed; it appears as correlation of neighbours in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from fitter.arrays import FloatArray, IntArray
from fitter.linear import orthonormal
from fitter.sums_of_squares import NAN, FTest, centred, off, own_parameters, ratio

_DRIFTS = 0.05
_WANDERS = 1e-3
_INFLATED = 1.1
"""Inflation below which drift hides no more than scatter does."""


@dataclass(frozen=True)
class Blind:
    """Reasons why a lack of fit may not be significant.

    Attributes:
        inflation: mean square of readings at one point over that beyond each replication's own parameters; 1 if the
            parameters do not drift between replications.
        bias: test of lack of fit against the latter, with the replications' own parameters in the model.
        wander: correlation of neighbours in time of the remaining residuals; 0 if it is not significant.
        wander_p: probability of a larger one by chance.
    """

    inflation: float
    bias: FTest
    wander: float
    wander_p: float

    @property
    def lacks_fit(self) -> bool:
        """Whether lack of fit is significant with drift between replications removed from the denominator."""
        return bool(self.bias.value > self.bias.limit_95)

    @property
    def sentence(self) -> str:
        """A sentence for people."""
        texts = []
        if self.inflation > 1.0:
            test = f"F {self.bias.value:.3g}, 95 % limit {self.bias.limit_95:.3g}"
            texts.append(
                f"T_bias can miss a lack of fit here: drift between replications makes its denominator "
                f"{self.inflation:.2g} times as large; against the scatter without that drift, lack of fit is "
                f"{'SIGNIFICANT' if self.lacks_fit else 'not significant'} ({test})"
            )
        if self.wander > 0.0:
            which = "that test" if texts else "T_bias"
            texts.append(
                f"{which} cannot see a lack of fit smaller than the wander within replications, which is in its "
                f"denominator (readings next to each other in time correlate by {self.wander:.2f})"
            )
        return "; ".join(texts)


def blind(
    output: FloatArray,
    extra: FloatArray,
    columns: FloatArray,
    within: FloatArray,
    point: IntArray,
    replicate: IntArray,
    drift: FTest,
    pure_error: float,
) -> Blind | None:
    """Reasons why the test of lack of fit can miss one; None if there are none.

    Args:
        output: (n,) outputs, volts, rows in order of time.
        extra: (n, q) columns of effects fitted together with the model.
        columns: (n, L) rows of the model.
        within: (n, r) orthonormal basis of the span of effects and replications' own parameters within points.
        point: (n,) point of the design, from 0.
        replicate: (n,) replication, from 0.
        drift: the joint test of drift between replications.
        pure_error: mean square of readings at one point.
    """
    left = off(centred(output[:, None], point), within)[:, 0]
    rest = float(left @ left)
    if drift.df_below <= 0 or rest <= 0.0:
        return None
    inflation = pure_error * drift.df_below / rest
    drifts = bool(drift.p < _DRIFTS) and inflation >= _INFLATED
    wander, p = _wander(left, within, point, replicate, drift.df_below)
    if not drifts and p >= _WANDERS:
        return None
    bias = FTest(NAN, 0, drift.df_below)
    if drifts:
        every = orthonormal(np.column_stack([extra, own_parameters(columns, replicate)]))
        beyond = float(np.sum(off(output, every) ** 2))
        bias = ratio(beyond - rest, len(output) - every.shape[1] - drift.df_below, rest, drift.df_below)
    return Blind(inflation if drifts else 1.0, bias, wander if p < _WANDERS else 0.0, p)


def _wander(left: FloatArray, within: FloatArray, point: IntArray, replicate: IntArray, df: int) -> tuple[float, float]:
    """Correlation of neighbours in time beyond that caused by the fit, and its one-sided probability.

    Its mean and variance for white noise seen through the projection are exact (Durbin and Watson, Biometrika 37,
    1950); its distribution is taken as normal.
    """
    size = np.bincount(point)
    points = np.zeros((len(left), len(size)))
    points[np.arange(len(left)), point] = 1.0 / np.sqrt(size[point])
    basis = np.column_stack([points, within])
    joined = np.where(replicate[1:] == replicate[:-1], 0.5, 0.0)[:, None]
    lagged = np.zeros_like(basis)
    lagged[:-1] += joined * basis[1:]
    lagged[1:] += joined * basis[:-1]
    inner = basis.T @ lagged
    trace = -float(np.trace(inner))
    square = 2.0 * float(np.sum(joined**2)) - 2.0 * float(np.sum(lagged**2)) + float(np.sum(inner * inner.T))
    variance = 2.0 * (df * square - trace**2) / (df**2 * (df + 2.0))
    if variance <= 0.0:
        return 0.0, 1.0
    found = 2.0 * float(np.sum(joined[:, 0] * left[1:] * left[:-1])) / float(left @ left) - trace / df
    return found, float(special.ndtr(-found / np.sqrt(variance)))
