"""Limits and tail probabilities of the t and F distributions.

From `scipy.special`, not `scipy.stats`: the same functions, without its two seconds of import.
"""

from __future__ import annotations

from scipy import special

DISTINGUISHED = 0.9973
"""Probability of three standard errors, for a known error: the required difference between two explanations."""


def t_limit(level: float, df: float) -> float:
    """Two-tailed limit of Student's t: `|t|` is below it with probability `level`, for `df` degrees of freedom.

    Example:
        >>> round(t_limit(0.95, 10), 3)
        2.228
    """
    return float(special.stdtrit(df, 0.5 * (1.0 + level)))


def t_tail(t: float, df: float) -> float:
    """Two-tailed probability of exceeding `|t|` with `df` degrees of freedom.

    Example:
        >>> round(t_tail(2.228, 10), 3)
        0.05
    """
    return float(2.0 * special.stdtr(df, -abs(t)))


def f_limit(level: float, df_above: float, df_below: float) -> float:
    """Limit of F with probability `level`; NaN if one of the degrees of freedom is not positive."""
    if df_above <= 0 or df_below <= 0:
        return float("nan")
    return float(special.fdtri(df_above, df_below, level))


def f_tail(f: float, df_above: float, df_below: float) -> float:
    """Probability of exceeding F; NaN if one of the degrees of freedom is not positive.

    An F below zero is a zero that rounding made negative: a difference of two sums of squares that are equal. It is
    exceeded for certain, on every processor.
    """
    if df_above <= 0 or df_below <= 0:
        return float("nan")
    # not max(f, 0.0): that would turn an F that is not a number into zero
    return float(special.fdtrc(df_above, df_below, 0.0 if f < 0.0 else f))
