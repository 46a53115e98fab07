"""Do calibrations differ by more than their own error?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fitter.history.components import Between, Profile
from fitter.history.series import Series
from fitter.quantiles import f_limit, f_tail


@dataclass(frozen=True)
class Homogeneity:
    """The F test of one-way analysis of variance, calibrations against what is within them.

    Attributes:
        F: mean square between calibrations over its expectation if they differed by their own error only.
        df: degrees of freedom above and below.
        limit_95: F stays below with 95 % probability if nothing changed.
        p: probability of a larger F if nothing changed.
        between_sd: standard deviation between calibrations beyond their own error (Paule and Mandel).

    """

    F: float
    df: tuple[int, float]
    limit_95: float
    p: float
    between_sd: float


def homogeneity(series: Series) -> Homogeneity:
    """Test that the parameter is the same in all calibrations; exact where all are of one design."""
    profile = Profile.of(series, series.constant, Between.SCATTER)
    df = profile.df, float(series.df)
    value = float(np.sum(profile.squares)) / profile.df
    return Homogeneity(value, df, f_limit(0.95, *df), f_tail(value, *df), float(np.sqrt(profile.paule_mandel())))
