"""Sentences about a control chart, suitable for a certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rig.fitter.history import Chart, QuantityChart
from rig.fitter.rounding import with_error
from rig.procedures.evaluate.charting import Shown


def quantity_sentences(
    chart: Chart, dates: Sequence[str], shown: Mapping[str, Shown], span_days: float | None = None
) -> list[str]:
    """Changes, one sentence per parameter; one sentence if there are none.

    Args:
        chart: the statistics.
        dates: of the calibrations.
        shown: how parameters are told.
        span_days: days from the first to the last calibration, if too few for rates per year.
    """
    found = [text for q in chart.quantities if (text := _change(q, dates, shown[q.name], span_days))]
    if not found:
        enough = "" if len(dates) > 2 else " (two calibrations; a trend needs three)"
        found = [f"no parameter changed by more than the calibrations' own error{enough}"]
    for q in chart.quantities:
        if q.limits is not None and q.limits.out.any():
            when = ", ".join(date for date, out in zip(dates, q.limits.out, strict=True) if out)
            found.append(f"{shown[q.name].label} of {when} is outside the 99.7 % limits")
    return found


def due_sentence(due: Mapping[str, Any], count: int, told: bool) -> str:
    """Due date of the last calibration."""
    unit = due["unit"]
    of = f"for {due['tolerance']:.2g} {unit}" + ("" if told else " (the 95 % interval of one reading)")
    if due["status"] == "too few":
        return f"a due date needs three calibrations; there are {count}"
    if due["status"] == "too short":
        return f"no due date: {count} calibrations {_within(due['span_days'])} say nothing of the months to come"
    if due["status"] == "never within":
        return (
            f"no due date {of}: {count} such calibrations have an uncertainty of {due['bound_at_once']:.2g} {unit} on "
            f"the day of the last; more calibrations, more replications or a wider tolerance give one"
        )
    if due["status"] == "overdue":
        return f"already due {of}: since {due['date']} ({-due['days']} days ago)"
    if due["status"] == "not known":
        return (
            f"whether it is due {of} is not known: it was expected within until {due['date']} ({-due['days']} days "
            f"ago), where the forecast ends, which is as long as the time between calibrations"
        )
    ends = ", the limit of the forecast, as long as the time between calibrations" if due["at_least"] else ""
    return f"due again on {due['date']} (in {due['days']} days) {of}{ends}"


def due_date(due: Mapping[str, Any]) -> str:
    """A due date for a table."""
    if due["status"] in {"never within", "too short"}:
        return "-"
    return f"{due['date']}{' or later' if due['at_least'] else ''}{' (past)' if due['status'] == 'overdue' else ''}"


def _within(days: float) -> str:
    return f"within {days:.0f} days" if days >= 1.5 else f"within {24 * days:.0f} hours"


def probability(p: float) -> str:
    """A probability as 0.003, or < 0.0001."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def _chance(p: float) -> str:
    return f"p {probability(p)}"


def _change(q: QuantityChart, dates: Sequence[str], shown: Shown, span_days: float | None) -> str:
    label, scale, unit = shown.label, shown.scale, shown.unit
    if q.stepped and q.step is not None:
        between = f"between {dates[q.step.before - 1]} and {dates[q.step.before]}"
        size = " +- ".join(with_error(scale * q.step.size, scale * q.step.stderr, sign=True))
        p = _chance(q.adjusted["step"])
        advice = "if its cause is known and over, chart the calibrations after it alone"
        return f"{label} stepped by {size} {unit} {between} (+- one standard error, {p}); {advice}"
    if q.trend is not None and q.significant("trend"):
        times, end = (scale, "/year") if span_days is None else (scale * span_days / 365.25, f" {_within(span_days)}")
        rate = f"{' +- '.join(with_error(times * abs(q.trend.per_year), times * q.trend.stderr))} {unit}{end}"
        falls = q.trend.per_year < 0
        p = _chance(q.adjusted["trend"])
        if q.steady:
            return f"{label} {'falls' if falls else 'rises'} by {rate} (+- one standard error, {p})"
        return (
            f"{label} has {'fallen' if falls else 'risen'} by {rate} so far (+- one standard error, {p}); "
            f"a random walk can do that as well ({_chance(q.trend.p_walk)}), so it may not go on"
        )
    if q.significant("homogeneity"):
        if len(q.series) == 2:
            apart = scale * abs(float(q.series.values[1] - q.series.values[0]))
            p = _chance(q.adjusted["homogeneity"])
            beyond = f"{apart:.2g} {unit}, more than their own error ({p}); a trend needs three"
            return f"{label} differs between the two calibrations by {beyond}"
        beyond = f"{scale * q.homogeneity.between_sd:.2g} {unit}"
        return (
            f"{label} differs between calibrations by {beyond} (standard deviation) beyond their own error "
            f"({_chance(q.adjusted['homogeneity'])}), without a clear trend"
        )
    return ""
