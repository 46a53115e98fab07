"""Findings of a trace of a table, for printing and plots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, isfinite

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import JsonValue
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.found import TracedSensor
from rig.fitter.trace.outcome import OF_REPLICATIONS, Finding, Row, absent
from rig.procedures.general.trace.estimate import Constant, Estimate
from rig.procedures.general.trace.run import Found as Search

MOST = 100.0
"""Logarithm of a ratio that is as good as infinite."""


@dataclass(frozen=True, eq=False)
class FoundTableEffect(Finding):
    """An effect in a table.

    Attributes:
        family: general word: "nonlinearity", "periodic", "temperature", "drift", "group", ...
        columns: its columns of the table.
        contribution: (n,) its contribution to the response, beyond the part absorbed by the declared model; zero for
            noise.
        other_causes: number of its aliases of another family or over other columns.
        intervals: for a finding about noise, ratio of true standard error to that of least squares with independent,
            equal rows, by coefficient of the declared model.
        df: degrees of freedom of its standard errors, the fewest; None for noise.
        given: (d,) standard errors of its coefficients with searched constants as found, for what it adds to the
            response, which hardly depends on them; () for noise.
        dynamic: whether what it adds depends on how long settings were held.
        constants: its searched constants that have a name.
        searched: its terms with those that have none, such as the time of a step.
        time_unit: unit of the time of the table, which is that of a time constant; "" if unknown.
    """

    family: str = field(kw_only=True)
    columns: tuple[str, ...] = field(kw_only=True)
    contribution: FloatArray = field(kw_only=True)
    other_causes: int = field(default=0, kw_only=True)
    intervals: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    df: float | None = field(default=None, kw_only=True)
    given: tuple[float, ...] = field(default=(), kw_only=True)
    dynamic: bool = field(default=False, kw_only=True)
    constants: tuple[Constant, ...] = field(default=(), kw_only=True)
    searched: tuple[str, ...] = field(default=(), kw_only=True)
    time_unit: str = field(default="", kw_only=True)

    @property
    def rms(self) -> float:
        """Root mean square of its contribution."""
        return float(np.sqrt(np.mean(self.contribution**2)))

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for tables only."""
        return {
            "family": self.family,
            "columns": list(self.columns),
            "intervals": dict(self.intervals),
            "rms": self.rms,
            "constants": [self._constant(one) for one in self.constants],
            "searched": list(self.searched),
        }

    def _constant(self, one: Constant) -> dict[str, JsonValue]:
        """A time constant with the interval of its logarithm, so that none is below zero."""
        known = isfinite(one.stderr) and one.df > 0
        times = exp(min(t_limit(0.95, one.df) * one.stderr / one.value, MOST)) if known else 1.0
        return {
            "name": one.what,
            "estimate": one.value,
            "stderr": one.stderr if known else None,
            "unit": self.time_unit,
            "interval_95": [one.value / times, one.value * times] if known else None,
        }


@dataclass(frozen=True, eq=False)
class TableSide:
    """Fit of a table before or after the effects.

    Attributes:
        fit: of the model.
        cv_rms: rms error of rows left out of search and fit; None if too few would remain.
        sigma_pure: of rows that repeat one setting, with the effects removed; None without repeats.
        shared: standard deviations within and between whole plots, if the declared model has them.
        shares: what these are called, "whole plots" or "replications".
    """

    fit: Estimate
    cv_rms: float | None
    sigma_pure: float | None
    shared: tuple[float, float] | None
    shares: str = "whole plots"

    def rows(self) -> tuple[Row, ...]:
        """The same in the form of every kind of run, with the keys of other kinds as null."""
        within, between = self.shared or (None, None)
        return (
            _row(
                "sigma_E",
                self.fit.sigma_E,
                "standard error of one row",
                "of least squares, with equal weights of all rows",
            ),
            *absent(OF_REPLICATIONS[1:]),
            Row("df_E", self.fit.df),
            _row(
                "sigma_pure",
                self.sigma_pure,
                "of rows that repeat one setting",
                "no model of the settings can go below it; after: what the effects make of them taken out",
            ),
            _row("sigma_subplot", within, f"within {self.shares}", "by restricted maximum likelihood"),
            _row("sigma_wholeplot", between, f"between {self.shares}", "of the error that their rows share"),
            *absent(("sigma_replicate", "reading_error_pct")),
            _row("cv_rms", self.cv_rms, "left-out error", "rms error at rows that were left out of search and fit"),
        )


def _row(name: str, value: float | None, label: str, meaning: str) -> Row:
    return Row(name, value, meaning=meaning, label=label, digits=4, where_known=True)


@dataclass(frozen=True, eq=False)
class TableTrace(TracedSensor[TableSide, FoundTableEffect]):
    """Findings in a table.

    Attributes:
        names: of the declared model's columns.
        y: (n,) the response.
        variables: (n,) columns for plots of residuals, by name.
        levels: names of the levels of groups among them, whose values are indices from zero.
        left_out: groups of rows left out for `cv_rms`.
        search: the search that ended with these effects.
    """

    names: tuple[str, ...]
    y: FloatArray
    variables: Mapping[str, FloatArray]
    levels: Mapping[str, tuple[str, ...]]
    left_out: str | None
    search: Search

    @property
    def response(self) -> str:
        """Its name."""
        return self.sensor
