"""Test of differences between calibrations beyond their own error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.history.between_calibrations import Between, Profile
from rig.fitter.history.series import Series
from rig.fitter.quantiles import f_limit, f_tail


@dataclass(frozen=True)
class Homogeneity:
    """The F test of one-way analysis of variance, between against within calibrations.

    Attributes:
        F: mean square between calibrations over its expectation by their own error.
        df: degrees of freedom above and below.
        limit_95: 95 % limit of F without change.
        p: probability of a larger F without change.
        between_sd: standard deviation between calibrations beyond their own error (Paule and Mandel).
    """

    F: float
    df: tuple[int, float]
    limit_95: float
    p: float
    between_sd: float


def homogeneity(series: Series) -> Homogeneity:
    """Test that the parameter is the same in all calibrations; exact if all have one design."""
    profile = Profile.of(series, series.constant, Between.SCATTER)
    df = profile.df, float(series.df)
    value = float(np.sum(profile.squares)) / profile.df
    return Homogeneity(value, df, f_limit(0.95, *df), f_tail(value, *df), float(np.sqrt(profile.paule_mandel())))
