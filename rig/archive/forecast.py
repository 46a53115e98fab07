"""The day on which a result of an item may no longer be within its tolerance, by the drift over its calibrations.

The value at a later time has a normal distribution, given the variances: the best linear unbiased prediction from a
straight line and the variation between calibrations (`rig.fitter.history.forecast`), with its uncertainty. A result is
due when the probability that it is within its tolerance falls below 95 %, by either kind of variation. The forecast
ends after as long a time as the history has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from math import inf
from typing import Any

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.history import Between, Series
from rig.fitter.history.forecast import predict

FEWEST = 3
HELD = 0.95
"""Probability of being within the tolerance below which a result is due."""
_DAYS = 365.25
_TIMES = 40
_MANY = 1e6
"""Degrees of freedom of a standard uncertainty of a certificate: its own are in the coverage factor."""


@dataclass(frozen=True)
class Forecast:
    """When an item is due by the drift of its results.

    Attributes:
        on: ISO date; "" if it is not known.
        at_least: whether the forecast ends on that date, with every result within its tolerance.
        by: label of the result that is due first; "" if there is none.
        why: what is not known, a sentence; "" if all is.
    """

    on: str = ""
    at_least: bool = False
    by: str = ""
    why: str = ""

    @property
    def words(self) -> str:
        """The date and the result that is due first, and what is not known."""
        if not self.on:
            return self.why
        day = f"not before {self.on}" if self.at_least else self.on
        return f"{day}: {self.by}{f'; {self.why}' if self.why else ''}"


def forecast(history: Sequence[tuple[str, Mapping[str, Any]]]) -> Forecast:
    """When an item is due.

    Args:
        history: ISO date of each calibration, in order of time, and its `values` with `adjusted`.
    """
    last = history[-1][1]
    if not last["values"]:
        return Forecast(why="its last certificate states no result with a tolerance")
    # An adjustment begins a new history: values as left are its first, and what is as found belongs to the one before.
    since = max((i for i, (_, one) in enumerate(history) if one["adjusted"]), default=0)
    if len(history) - since < FEWEST:
        what = "after its adjustment" if since else "with its tolerances"
        return Forecast(why=f"fewer than {FEWEST} calibrations {what}: its drift is not known")
    as_left = since == len(history) - 1 and bool(last["adjusted"])
    found = [_due(value, history[since:]) for value in last["values"] if value["left"] == as_left]
    known = [one for one in found if one.on]
    if not known:
        return found[0]
    first = min(known, key=lambda one: (one.on, one.at_least))
    others = len(found) - len(known)
    return replace(first, why=f"{others} of {len(found)} results are not forecast") if others else first


def _due(value: Mapping[str, Any], history: Sequence[tuple[str, Mapping[str, Any]]]) -> Forecast:
    days: list[date] = []
    values, errors = [], []
    for i, (day, one) in enumerate(history):
        left = i == 0 and bool(one["adjusted"])
        same = [v for v in one["values"] if (v["what"], v["unit"], v["left"]) == (value["what"], value["unit"], left)]
        if same and (not days or date.fromisoformat(day) > days[-1]):
            days.append(date.fromisoformat(day))
            values.append(float(same[0]["value"]))
            errors.append(float(same[0]["standard"]))
    if len(days) < FEWEST:
        return Forecast(why=f"{value['what']} is on fewer than {FEWEST} certificates of different days")
    years = np.array([(day - days[0]).days / _DAYS for day in days])
    ages = years[-1] * np.linspace(0.0, 1.0, _TIMES) ** 2
    series = Series(years, np.array(values), np.maximum(np.array(errors), 1e-12 * abs(values[-1])) ** 2, _MANY)
    within = np.min([_within(series, between, ages, value) for between in Between], axis=0)
    out = np.flatnonzero(within < HELD)
    if not out.size:
        return Forecast(_on(days[-1], float(ages[-1])), at_least=True, by=value["what"])
    at = int(out[0])
    age = 0.0 if at == 0 else float(np.interp(HELD, within[[at, at - 1]], ages[[at, at - 1]]))
    return Forecast(_on(days[-1], age), by=value["what"])


def _within(series: Series, between: Between, ages: FloatArray, value: Mapping[str, Any]) -> FloatArray:
    """(T,) probability that the value is within its tolerance at (T,) ages."""
    found, now = predict(series, between, ages), float(series.values[-1])
    sd = np.maximum(found.sd, np.finfo(float).tiny)
    lower, upper = (
        -inf if value["lower"] is None else value["lower"],
        inf if value["upper"] is None else value["upper"],
    )
    inside = special.ndtr((upper - now - found.mean) / sd) - special.ndtr((lower - now - found.mean) / sd)
    return np.asarray(inside.mean(axis=0))


def _on(last: date, age: float) -> str:
    return (last + timedelta(days=int(age * _DAYS))).isoformat()
