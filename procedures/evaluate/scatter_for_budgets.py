"""Scatter of readings for budgets: residuals of the fit, or differences between repeats.

An error of a head or of weights that repeats at its settings stands in the residuals as lack of fit. A budget has a
line for it, so its scatter must not have it again. Differences between repeats are free of it. They are used if lack
of fit is significant and no larger than the errors that the register states can make it. A larger one is something
else: residuals are then used, and it is said.
"""

from __future__ import annotations

from dataclasses import dataclass

from rig.fitter.quantiles import f_tail

SIGNIFICANT = 0.05
FARTHEST = 6.63
"""99 % point of chi squared with one degree of freedom: the largest part that a single stated error may have."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of one reading.

    Attributes:
        variance: of one reading.
        df: its degrees of freedom.
        lacks_fit: whether lack of fit is significant.
        explained: whether the register's errors can be the reason.
    """

    variance: float
    df: float
    lacks_fit: bool
    explained: bool

    def sentence(self, name: str) -> str:
        """A sentence about lack of fit; "" without any."""
        if not self.lacks_fit:
            return ""
        if self.explained:
            return (
                f"{name}: lack of fit is as large as the register's errors of settings make it; scatter is taken from "
                f"differences between repeats"
            )
        return (
            f"{name}: lack of fit is significant, and larger than the register's errors of settings make it: the model "
            f"lacks something, and the numbers of the model itself do not have what that moves"
        )


def scatter(residual_ss: float, df: float, pure_ss: float, pure_df: float, expected_ss: float) -> Scatter:
    """Scatter of the readings of one sensor.

    Args:
        residual_ss: sum of squared residuals of the fit.
        df: its degrees of freedom.
        pure_ss: sum of squared differences of repeats from their means.
        pure_df: its degrees of freedom.
        expected_ss: expected sum of squares in the residuals by stated errors that repeat at settings.
    """
    plain = residual_ss / df
    lack_df, lack_ss = df - pure_df, residual_ss - pure_ss
    if pure_df < 1 or lack_df < 1 or pure_ss <= 0.0:
        return Scatter(plain, df, lacks_fit=False, explained=False)
    pure = pure_ss / pure_df
    if f_tail(lack_ss / lack_df / pure, lack_df, pure_df) >= SIGNIFICANT:
        return Scatter(plain, df, lacks_fit=False, explained=False)
    if lack_ss - lack_df * pure > FARTHEST * expected_ss:
        return Scatter(plain, df, lacks_fit=True, explained=False)
    return Scatter(pure, pure_df, lacks_fit=True, explained=True)
