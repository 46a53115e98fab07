"""Findings of a trace of a table, for printing and plots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, isfinite

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import JsonValue
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.found import CONFIRMED, Found, Unnamed
from rig.fitter.trace.outcome import (
    CONDITIONAL,
    LEFT_OUT,
    OF_REPLICATIONS,
    UNSIGNED,
    Instead,
    Outcome,
    Parameter,
    Row,
    WithError,
    absent,
)
from rig.procedures.general.trace.estimate import Constant, Estimate
from rig.procedures.general.trace.run import Found as Search

MOST = 100.0
"""Logarithm of a ratio that is as good as infinite."""


@dataclass(frozen=True, eq=False)
class FoundTableEffect(Found):
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
        time_unit: unit of the time of the table, which is that of a time constant; "" if unknown.
    """

    family: str
    columns: tuple[str, ...]
    contribution: FloatArray
    other_causes: int = 0
    intervals: Mapping[str, float] = field(default_factory=dict)
    df: float | None = None
    given: tuple[float, ...] = ()
    dynamic: bool = False
    constants: tuple[Constant, ...] = ()
    time_unit: str = ""

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
class TableTrace:
    """Findings in a table.

    Attributes:
        response: its name.
        declared: the declared model.
        names: of its columns.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained"; findings about the noise add
            nothing to the model.
        before: with the declared model.
        after: with the effects.
        effects: found, largest share first, findings about the noise last.
        unnamed: the remainder, if it exceeds error.
        remarks: about noise and the measurement of the error.
        variables: (n,) columns for plots of residuals, by name.
        levels: names of the levels of groups among them, whose values are indices from zero.
        left_out: groups of rows left out for `cv_rms`.
        instead: one shape without a name in place of the doubtful effects.
        search: the search that ended with these effects.
    """

    response: str
    declared: str
    names: tuple[str, ...]
    verdict: str
    before: TableSide
    after: TableSide
    effects: tuple[FoundTableEffect, ...]
    unnamed: tuple[Unnamed, ...]
    remarks: tuple[str, ...]
    y: FloatArray
    variables: Mapping[str, FloatArray]
    levels: Mapping[str, tuple[str, ...]]
    left_out: str | None
    search: Search
    instead: Instead | None = None

    @property
    def added(self) -> tuple[FoundTableEffect, ...]:
        """Effects that add to the model."""
        return tuple(effect for effect in self.effects if effect.stratum != "noise")

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences shown with the numbers before and after."""
        notes = list(self.remarks)
        if self.added:
            notes.append(CONDITIONAL)
            notes.append(UNSIGNED)
        before, after = self.before.cv_rms, self.after.cv_rms
        if self.left_out and before is not None and after is not None:
            if self.added and after > CONFIRMED * before:
                notes.append(
                    f"not confirmed by {self.left_out} left out: with the effects found the error on those is "
                    f"{after / before:.0%} of what it is without them"
                )
            notes.append(f"{LEFT_OUT}{self.left_out} in turn left out, the search repeated without them")
        return tuple(notes)

    def outcome(self) -> Outcome:
        """The same in the form of every kind of run."""
        return Outcome(
            sensor=self.response,
            declared=self.declared,
            verdict=self.verdict,
            findings=(*(one.finding() for one in self.effects), *(rest.finding() for rest in self.unnamed)),
            before=self.before.rows(),
            after=self.after.rows(),
            fitted=self._fitted(),
            notes=self.notes,
            instead=self.instead,
        )

    def _fitted(self) -> tuple[Parameter, ...]:
        fit = self.after.fit
        declared = zip(self.names, fit.coefficients, fit.stderr, fit.dfs, strict=False)  # effects come after them
        own = (Parameter(name, WithError(float(v), float(e), float(df))) for name, v, e, df in declared)
        return (*own, *(one for effect in self.added for one in effect.parameters))
