"""The report of a trace in any table: findings, error before and after, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from procedures.effects_page import effects_part
from procedures.general.plots import residuals_over
from procedures.results import Page

if TYPE_CHECKING:
    from procedures.general.evaluate import GeneralTraced

_ROWS = (
    ("sigma_E", "standard error of one row", "of least squares, every row counted alike"),
    (
        "sigma_pure",
        "of rows that repeat one setting",
        "no model of the settings can go below it; after: what the effects make of them taken out",
    ),
    ("sigma_subplot", "within whole plots", "by restricted maximum likelihood"),
    ("sigma_wholeplot", "between whole plots", "of the error that rows of a whole plot share"),
    ("cv_rms", "left-out error", "rms error at rows that neither search nor fit have seen"),
)
_PLOTS = 6


def trace_page(traced: GeneralTraced) -> Page:
    """The report of a trace."""
    result = traced.to_json()
    name, found = next(iter(result["sensors"].items()))
    before, after = found["before"], found["after"]
    contents = {
        **found,
        "name": name,
        "rows": [
            {"label": label, "before": _number(before[key]), "after": _number(after[key]), "meaning": meaning}
            for key, label, meaning in _ROWS
            if before[key] is not None or after[key] is not None
        ],
        "s": effects_part(found, {}),
        "plots": _plots(traced),
        "coefficients": [
            {"name": term, "estimate": _number(value["estimate"], 6), "stderr": _number(value["stderr"], 3)}
            for term, value in found["fitted"]["coefficients"].items()
        ],
    }
    return Page("procedures.general", "page.html.j2", traced.table, 0.0, result["unused"], contents)


def _plots(traced: GeneralTraced) -> list[dict[str, Any]]:
    """Residuals before and after, over each effect's own variable; over all variables without findings."""
    trace = traced.trace
    wanted = dict.fromkeys(effect.against for effect in trace.added if effect.against in trace.variables)
    shown = list(wanted or trace.variables)[:_PLOTS]
    left = trace.before.fit.left, trace.after.fit.left
    return [
        {
            "alt": f"residuals of {trace.response} over {name}, before and after",
            "figure": residuals_over(name, trace.variables[name], left, trace.response, trace.levels.get(name)),
        }
        for name in shown
    ]


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None or value != value else f"{value:.{digits}g}"  # noqa: PLR0124 - NaN is not itself
