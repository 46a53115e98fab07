"""Tails of distributions for what watches a run: `scipy.special` takes half a second to import, and few points need it.

At a prompt nobody waits for it. Fits and traces have `rig.fitter.quantiles`.
"""

from __future__ import annotations


def chance_f(of: float, to: float, ratio: float) -> float:
    """Probability of a ratio of variances at least this large."""
    from scipy.special import fdtrc  # noqa: PLC0415 - see above

    return float(fdtrc(of, to, ratio))


def chance_t(df: float, t: float) -> float:
    """Probability of a t below this value."""
    from scipy.special import stdtr  # noqa: PLC0415 - see above

    return float(stdtr(df, t))
