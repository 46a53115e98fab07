"""Sentences about errors of pressure transducers that terminal, report and acceptance share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

HOLD_AT = "coefficients are of P in psia and temperatures in degC as measured: each holds where the others are zero"
LOW_PSIA = 0.12
"""Pressure at which the paper compares its methods."""


IN_USE = (
    "in use: readings predicted by other whole plots, or with in-flight zero by one zero reading of their own, whose "
    "error counts; ± is the 95 % interval of one reading, ? where no reading can be compared with a prediction"
)


def errors_in_words(sensor: Mapping[str, Any]) -> str:
    """Sentence about the errors of a reading, with growth with pressure."""
    errors = sensor["errors"]
    s_0, growth = errors["subplot_variance"] ** 0.5, errors["growth_per_psia"]
    between = f"{errors['wholeplot_variance'] ** 0.5:.3g} mV between whole plots"
    if growth == 0.0:
        return f"errors: {s_0:.3g} mV within whole plots, {between}"
    return f"errors: {s_0:.3g} mV + {s_0 * growth:.3g} mV/psi x P within whole plots, {between}"


def errors_as_cells(sensor: Mapping[str, Any]) -> tuple[str, str]:
    """The errors of a reading, with growth with pressure, and of a whole plot, in mV, for a table."""
    errors = sensor["errors"]
    s_0, growth = errors["subplot_variance"] ** 0.5, errors["growth_per_psia"]
    grows = f" + {s_0 * growth:.3g} P/psi" if growth else ""
    return f"{s_0:.3g}{grows}", f"{errors['wholeplot_variance'] ** 0.5:.3g}"


def low_pressure(result: Mapping[str, Any]) -> tuple[int, float]:
    """Index and value of a fit's pressure nearest to the comparison pressure of methods."""
    sensor = next(iter(result["sensors"].values()))
    pressures = next(iter(sensor["methods"].values()))["reading_error"]["pressure_psia"]
    low = min((p for p in pressures if p > 0), key=lambda p: abs(p - LOW_PSIA))
    return pressures.index(low), low


def in_use_words(fitted: Mapping[str, Any], at: int) -> str:
    """A method's largest error in use at one pressure, and the 95 % interval of a reading there: "3.3±2.9"."""
    largest, half = fitted["in_use"]["max_pct"][at], fitted["in_use"]["half95_pct"][at]
    if half is None:
        return "-"
    return f"{'?' if largest is None else f'{largest:.3g}'}±{half:.2g}"


def largest_words(fitted: Mapping[str, Any], at: int) -> str:
    """A method's largest error in use at one pressure in a clause, with its probable range."""
    use = fitted["in_use"]
    largest, half = use["max_pct"][at], use["half95_pct"][at]
    if half is None:
        return "unknown in use"
    if largest is None:
        return f"not measured in use, because there is no other reading as zero; 95 % of readings within ±{half:.2g} %"
    low, high = use["max_by_chance_pct"][at]
    return (
        f"{largest:.3g} % in use, the largest of {use['count'][at]} (by chance {low:.2g} to {high:.2g} %; 95 % of "
        f"readings within ±{half:.2g} %)"
    )
