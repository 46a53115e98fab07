"""Control charts over several calibrations: drift of a sensor, and its next due date."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.fitter.history import Between, Chart, QuantityChart, chart
from rig.procedures.evaluate.charting import View
from rig.verbs.chart.inputs import Given, notes
from rig.verbs.chart.sentences import due_sentence, quantity_sentences
from rig.verbs.chart.together import LeftOut

DAYS = 365.25
SHORT_DAYS = 30.0
"""Calibrations within fewer days say nothing of a year: no rate per year, no due date."""
_TOLERANCES = (0.5, 1.0, 2.0, 4.0)
"""Factors of the requested tolerance, to show how the due date depends on it."""


@dataclass(frozen=True, eq=False)
class SensorChart:
    """One sensor over its calibrations.

    Attributes:
        name: column name of its output.
        given: its calibrations, in order of time.
        view: the charted parameters, and their names for people.
        chart: the statistics.
        tolerance: maximum error of the output, in its unit.
        told: whether the tolerance was given; otherwise it is the 95 % interval of one reading.
        today: date for "in N days".
    """

    name: str
    given: Sequence[Given]
    view: View
    chart: Chart
    tolerance: float
    told: bool
    today: datetime

    @property
    def model(self) -> str:
        """The fitted model."""
        return self.view.model

    @property
    def last(self) -> datetime:
        """Date of the last calibration."""
        return self.given[-1].when

    @property
    def span_days(self) -> float:
        """Days from the first calibration to the last."""
        return (self.last - self.given[0].when) / timedelta(days=1)

    def due(self, tolerance: float) -> dict[str, Any]:
        """Due date of the last calibration for a tolerance: a status and, if there is one, a date.

        "too few": fewer than three calibrations. "too short": all within `SHORT_DAYS`. "never within": not even on the
        date of the last calibration. "due": on a future date. "overdue": on a past date. "not known": the forecast
        ended on a past date, and within the tolerance. `at_least` means that the date is the end of the forecast, not
        of the tolerance.
        """
        answer: dict[str, Any] = {"tolerance": tolerance, "unit": self.view.unit}
        bound = self.chart.bound
        if bound is None:
            return {**answer, "status": "too few"}
        if self.span_days < SHORT_DAYS:
            return {**answer, "status": "too short", "span_days": self.span_days}
        years = bound.holds_for(tolerance)
        by_kind = {kind.value: self._date(bound.holds_for(tolerance, kind)) for kind in Between}
        if years is None:
            at_once = max(float(b[0]) for b in bound.bounds.values())
            return {**answer, "status": "never within", "bound_at_once": at_once, "by_variation": by_kind}
        days = int(np.floor((self.last + timedelta(days=DAYS * years) - self.today) / timedelta(days=1)))
        at_least = years >= float(bound.years[-1])
        return {
            **answer,
            "status": "due" if days >= 0 else "not known" if at_least else "overdue",
            "date": self._date(years),
            "days": days,
            "at_least": at_least,
            "governs": bound.governs(tolerance).value,
            "by_variation": by_kind,
        }

    def _by_tolerance(self) -> list[dict[str, Any]]:
        """Due dates for tolerances around the requested one, up to the first beyond the forecast."""
        rows: list[dict[str, Any]] = []
        for factor in _TOLERANCES:
            if factor <= 1.0 or not rows[-1].get("at_least"):
                rows.append(self.due(factor * self.tolerance))
        return rows

    def drift(self) -> list[tuple[float, float]]:
        """Rows [days since the last calibration, drift not exceeded with 95 %], for a register of equipment.

        The bound on the error on the day of the calibration is taken out in squares, for a budget has it as scatter of
        the fit: with that the sum is the bound again.

        Raises:
            UsageError: there are fewer than three calibrations.
        """
        bound = self.chart.bound
        if bound is None:
            raise UsageError(f"{self.name}: drift is not known of fewer than three calibrations")
        worst = np.max(list(bound.bounds.values()), axis=0)
        grown = np.maximum.accumulate(np.sqrt(np.maximum(worst**2 - worst[0] ** 2, 0.0)))
        days = np.round(DAYS * bound.years, 1)
        return [(float(day), float(f"{error:.3g}")) for day, error in zip(days, grown, strict=True)]

    def _date(self, years: float | None) -> str | None:
        return None if years is None else f"{self.last + timedelta(days=DAYS * years):%Y-%m-%d}"

    def to_json(self) -> dict[str, Any]:
        """JSON values of this sensor for `rig chart --json`."""
        table = self.view.charted
        dates = [one.date for one in self.given]
        due = self.due(self.tolerance)
        result: dict[str, Any] = {
            "model": self.model,
            "calibrations": [
                {
                    "date": one.date,
                    "file": one.source,
                    "run_id": one.provenance.get("run_id"),
                    "sensor_temperature_degC": one.of.degC,
                    "parameters": {
                        name: {"estimate": float(value), "stderr": float(error)}
                        for name, value, error in zip(table.shown, table.parameters[i], table.stderr[i], strict=True)
                    },
                    "outside": self._outside(i),
                }
                for i, one in enumerate(self.given)
            ],
            "quantities": {q.name: _quantity_json(q, dates) for q in self.chart.quantities},
            "errors_from_replications": table.replicated,
            "usage": list(self.view.usage),
            "tolerance_asked_for": self.told,
            "due": due,
            "due_by_tolerance": self._by_tolerance(),
        }
        if self.chart.bound is not None:
            bound = self.chart.bound
            result["error_bound"] = {
                "days": [float(DAYS * y) for y in bound.years],
                **{
                    f"{kind.value}_{self.view.unit}": [float(v) for v in values]
                    for kind, values in bound.bounds.items()
                },
            }
        span = self.span_days if self.span_days < SHORT_DAYS else None
        sentences = [f"{self.name}: {text}" for text in quantity_sentences(self.chart, dates, self.view.shown, span)]
        return {**result, "sentences": [*sentences, f"{self.name}: {due_sentence(due, len(dates), self.told)}"]}

    def _outside(self, i: int) -> dict[str, str]:
        """Parameters of calibration `i` outside their limits: "95 %" or "99.7 %"."""
        found = {}
        for q in self.chart.quantities:
            if q.limits is not None and q.limits.warned[i]:
                found[q.name] = "99.7 %" if q.limits.out[i] else "95 %"
        return found


def _quantity_json(q: QuantityChart, dates: Sequence[str]) -> dict[str, Any]:
    """Values, tests and limits of one parameter; None for statistics that need more calibrations."""
    series, spread = q.series, q.homogeneity
    result: dict[str, Any] = {
        "values": [float(v) for v in series.values],
        "stderr": [float(v) for v in np.sqrt(series.variance)],
        "df": series.df,
        "homogeneity": {
            "F": spread.F,
            "F_95": spread.limit_95,
            "df": list(spread.df),
            "p": spread.p,
            "p_adjusted": q.adjusted["homogeneity"],
            "between_sd": spread.between_sd,
        },
        "trend": None,
        "step": None,
        "limits": None,
    }
    if q.trend is not None:
        result["trend"] = {
            "per_year": q.trend.per_year,
            "stderr": q.trend.stderr,
            "half_width_95": q.trend.half_width_95,
            "df": q.trend.df,
            "p": q.trend.p,
            "p_adjusted": q.adjusted["trend"],
            "p_walk": q.trend.p_walk,
            "favoured": q.trend.favoured.value,
        }
    if q.step is not None:
        result["step"] = {
            "after": dates[q.step.before - 1],
            "before": dates[q.step.before],
            "size": q.step.size,
            "stderr": q.step.stderr,
            "p": q.step.p,
            "p_adjusted": q.adjusted["step"],
        }
    if q.limits is not None:
        result["limits"] = {
            "centre": q.limits.centre,
            "half_width_95": [float(v) for v in q.limits.warning],
            "half_width_99_7": [float(v) for v in q.limits.action],
        }
    return result


@dataclass(frozen=True, eq=False)
class ControlCharts:
    """All sensors of a set of calibrations.

    Attributes:
        given: the calibrations, in order of time.
        sensors: by output column.
        notes: notes for the reader.
        left_out: files that are not charted, with reasons.
    """

    given: Sequence[Given]
    sensors: Mapping[str, SensorChart]
    notes: Sequence[str]
    left_out: Sequence[LeftOut] = ()

    @property
    def simulated(self) -> bool:
        """Whether all calibrations are from simulated runs."""
        return self.given[0].of.simulated

    def to_json(self) -> dict[str, Any]:
        """JSON values of `rig chart --json`."""
        return {
            "data": {
                "kind": self.given[0].kind.name,
                "simulated": self.simulated,
                "calibrations": [
                    {"file": one.source, "date": one.date, **{k: v for k, v in one.provenance.items() if k != "file"}}
                    for one in self.given
                ],
            },
            "left_out": [{"file": one.source, "reason": one.reason} for one in self.left_out],
            "notes": list(self.notes),
            "sensors": {name: sensor.to_json() for name, sensor in self.sensors.items()},
        }


def chart_calibrations(
    given: Sequence[Given],
    today: datetime,
    *,
    sensors: Sequence[str] = (),
    tolerance: float | None = None,
    usage_deg: float | None = None,
    left_out: Sequence[LeftOut] = (),
) -> ControlCharts:
    """Chart every sensor that occurs in all calibrations.

    Args:
        given: at least two calibrations, in order of time.
        today: date for "in N days".
        sensors: names of the outputs to chart; none for all.
        tolerance: of the output, in its unit; None for the 95 % interval of one reading.
        usage_deg: range of use, plus and minus, degrees; None for the range of the last calibration.
        left_out: files that are not charted, to be named.

    Raises:
        UsageError: a sensor is not in all calibrations, or cannot be charted.
        DataError: this kind has no range of use.
    """
    common = [name for name in given[0].sensors if all(name in one.sensors for one in given)]
    for name in sensors:
        for one in given:
            if name not in one.sensors:
                raise UsageError(f"{one.source} has no sensor {name}; it has {', '.join(one.sensors)}")
    if not common:
        raise UsageError(
            f"no sensor is in all of these calibrations: {given[0].source} has {', '.join(given[0].sensors)}"
        )
    remarks = [f"{one.source} is left out: {one.reason}" for one in left_out] + notes(given)
    if not sensors:
        left = sorted({name for one in given for name in one.sensors} - set(common))
        remarks += [f"{name} is not in all of these calibrations and is left out" for name in left]
    years = np.array([(one.when - given[0].when) / timedelta(days=DAYS) for one in given])
    found = {}
    for name in dict.fromkeys(sensors or common):
        try:
            view = given[0].charting.view([one.sensors[name] for one in given], years, usage_deg)
        except FitError as error:
            raise UsageError(f"{name}: {error}") from error
        remarks += [f"{name}: {remark}" for remark in view.remarks]
        found[name] = SensorChart(
            name=name,
            given=given,
            view=view,
            chart=chart(view.charted, view.rows),
            tolerance=view.interval if tolerance is None else tolerance,
            told=tolerance is not None,
            today=today,
        )
    return ControlCharts(given, found, remarks, left_out)
