"""Where the test of lack of fit is blind: its denominator has more than scatter in it.

T_bias has the scatter of readings at one point as its denominator. Drift between replications and wander within them
are in that scatter too, so a lack of fit smaller than they are is not significant. Drift of the parameters between
replications can be taken out: lack of fit is then tested against what is left beyond each replication's own
parameters. Wander within replications cannot; it shows as correlation of neighbours in time.
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
"""Less than this hides nothing that scatter does not hide as well."""


@dataclass(frozen=True)
class Blind:
    """Why a lack of fit may not be significant.

    Attributes:
        inflation: mean square of readings at one point over that beyond each replication's own parameters; 1 where
            the parameters do not drift between replications.
        bias: lack of fit against the latter, beside the replications' own parameters.
        wander: correlation of neighbours in time of what is left of them; 0 where it is not significant.
        wander_p: probability of a larger one by chance.

    """

    inflation: float
    bias: FTest
    wander: float
    wander_p: float

    @property
    def lacks_fit(self) -> bool:
        """Whether lack of fit is significant once drift between replications is out of the denominator."""
        return bool(self.bias.value > self.bias.limit_95)

    @property
    def sentence(self) -> str:
        """For people."""
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
    """Why the test of lack of fit can miss one; None where nothing speaks for that.

    Args:
        output: (n,) volts, rows in order of time.
        extra: (n, q) columns of effects fitted together with the model.
        columns: (n, L) rows of the model.
        within: (n, r) orthonormal basis of what effects and replications' own parameters span within points.
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
    """Correlation of neighbours in time beyond what the fit itself gives, and its one-sided probability.

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
