"""The report of a trace of any kind: the first screen, and the values of each sensor for the kind's template."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rig.fitter.rounding import with_error
from rig.procedures.evaluate.before_after import compared
from rig.procedures.evaluate.front import front
from rig.procedures.evaluate.results import Page
from rig.procedures.present.effect_plots import drawn
from rig.procedures.present.effects_report import effects_part
from rig.procedures.present.numbers import number

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome, WithError
    from rig.procedures.evaluate.results import Traced

Plots = Sequence[Mapping[str, Any]]
"""Plots of residuals, each with its words for those who cannot see it ("alt") and its "figure"."""


def trace_page(
    traced: Traced,
    package: str,
    plots: Callable[[str], Plots],
    span_s: float = 0.0,
    own: Callable[[Outcome, Mapping[str, Any]], dict[str, Any]] = lambda outcome, result: {},
    **more: Any,
) -> Page:
    """The report, by the template `report.html.j2` of a kind.

    Args:
        traced: the trace.
        package: of the kind.
        plots: of a sensor, by its name.
        span_s: seconds from the first observation to the last; 0 if irrelevant.
        own: further values of a sensor, by its outcome and its JSON.
        more: further values of the template.
    """
    told, sensors = traced.to_json(), []
    for outcome in traced.outcomes:
        result = told["sensors"][outcome.sensor]
        sensors.append(_sensor(outcome, result) | own(outcome, result) | {"plots": plots(outcome.sensor)})
    contents = {"front": front(traced.outcomes, told["sensors"]), "sensors": sensors, **more}
    return Page(package, "report.html.j2", traced.table, span_s, told["unused"], contents)


def _sensor(outcome: Outcome, result: Mapping[str, Any]) -> dict[str, Any]:
    rows = list(compared(outcome))
    return {
        **result,
        "name": outcome.sensor,
        "rows": [row for row in rows if not row.setting],
        "by_setting": [row for row in rows if row.setting],
        "parameters": [
            {"name": one.label, "before": _text(one.before), "after": _text(one.after)} for one in outcome.parameters
        ],
        "coefficients": [
            {"name": term, "both": with_error(value["estimate"], value["stderr"]), "df": number(value.get("df"))}
            for term, value in result["fitted"]["coefficients"].items()
        ],
        **effects_part(result, drawn(outcome.figures)),
    }


def _text(one: WithError | None) -> tuple[str, str]:
    return ("-", "-") if one is None else with_error(one.value, one.stderr)
