"""Models of a pressure transducer's output: the paper's sets of terms, by name, and selection of terms.

McCollum, Commo and Parker, "Calibration Modeling Methodology to Optimize Performance for Low Range Applications".
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

import numpy as np

from rig.fitter import RankError, Triangle, ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.formula import Formula
from rig.fitter.formula_text import Factor, Numeric, Term
from rig.fitter.quantiles import t_tail
from rig.fitter.split_plot import SplitPlotFit, fit_split_plot
from rig.procedures.pressure.data import WholePlotData

FULL = "full"
"""Of second order in pressure and both temperatures."""
MODELS: Mapping[str, str] = {
    FULL: "(P + T_sensor + T_SSE)^2 + P^2 + T_sensor^2 + T_SSE^2",
    "II.C": "1 + P + T_sensor + P^2 + P:T_SSE + T_sensor^2",
    "eq10": "1 + P + P^2 + P:T_sensor + P:T_SSE",
}
"""Eq. (1); the list of section II.C, which is not hierarchical; eq. (10), meant for whole-plot indicators."""

ONE_TEMPERATURE = "(P + T_sensor)^2 + P^2 + T_sensor^2"
"""The full model without the temperature of the electronics."""

HIERARCHICAL = "hierarchical"
"""Name of the reduction of the full model, see `reduced`."""

KEPT_BELOW = 0.05
"""Largest probability at which a term stays in the reduced model."""

_SHORT = {"pressure_psia": "P", "sensor_temperature_degC": "T_sensor", "sse_temperature_degC": "T_SSE"}
_OF_WHOLE_PLOTS = frozenset({"T_sensor", "T_SSE", "replicate"})
_ALIKE = 1e-6


def named_formula(model: str, extra: tuple[str, ...] = ()) -> Formula:
    """Terms of a model: one of `MODELS`, "hierarchical" (its start) or a formula; and `extra` terms. Names of columns
    are converted to P, T_sensor and T_SSE.

    Raises:
        rig.fitter.formula.FormulaError: neither a name nor a formula.
    """
    formula = _parse(MODELS.get(model, MODELS[FULL] if model == HIERARCHICAL else model))
    for text in extra:
        formula = formula.plus(*(term for term in _parse(text).terms if len(term)))
    return formula


def check_determined(data: WholePlotData, formula: Formula) -> None:
    """Refuse a model that the design does not determine, even if the scatter of readbacks seems to.

    Raises:
        RankError: with the terms that are not separable at the measured settings.
    """
    if not set(formula.names) <= set(data.nominal):
        return
    names, columns = formula.columns(data.nominal)
    try:
        Triangle(names).add(columns, np.zeros(len(data))).solve()
    except RankError as error:
        temperatures = np.column_stack([data.nominal["T_sensor"], data.nominal["T_SSE"]])
        pairs, pressures = len(np.unique(temperatures, axis=0)), len(data.pressure_levels[0])
        raise RankError(
            f"{error}, at the {pairs} pairs of temperatures and {pressures} pressures that were set; "
            f"fit a smaller model"
        ) from error


def usual(data: WholePlotData) -> str:
    """The model where none is declared: the full one, if the settings determine it.

    Otherwise that of one temperature, if they determine that: often the electronics follow the chamber of the sensor.
    """
    for model in (FULL, ONE_TEMPERATURE):
        try:
            check_determined(data, named_formula(model))
        except RankError:
            continue
        return model
    return FULL


def of_whole_plot(term: Term) -> bool:
    """Whether a term is constant within whole plots, except for the scatter of temperature readbacks."""
    return all(name in _OF_WHOLE_PLOTS for name in term.names)


def contains(term: Term, other: Term) -> bool:
    """Whether `other` is a lower-order part of `term`, as P and T_SSE are of P:T_SSE, and P is of P^2."""
    high, low = _powers(term), _powers(other)
    return term != other and all(low[factor] <= high[factor] for factor in low)


def reduced(data: WholePlotData, output: str, formula: Formula, *, nested: bool) -> tuple[Formula, SplitPlotFit]:
    """Backward elimination with hierarchy: a term is kept while a term that contains it is. At every step, among the
    terms contained in no other, the one with the largest p of its Kenward-Roger t test is removed, if that is above
    `KEPT_BELOW`. The tests of such terms do not depend on the zeros of variables.
    """
    replicate = data.replicate if nested else None
    while True:
        names, columns = formula.columns(data.table)
        fit = fit_split_plot(columns, data.outputs[output], data.whole_plot, names, replicate=replicate)
        roger = fit.kenward_roger()
        t = fit.coefficients / np.sqrt(np.diag(roger.covariance))
        p = dict(zip(names, (t_tail(*pair) for pair in zip(t, fit.df, strict=True)), strict=True))
        free = [a for a in formula.terms if len(a) and not any(contains(b, a) for b in formula.terms)]
        worst = ties.least(free, key=lambda term: -p[str(term)]) if free else None
        if worst is None or p[str(worst)] <= KEPT_BELOW:
            return formula, fit
        formula = formula.without(worst)


def variance_inflation(
    formula: Formula, table: Mapping[str, FloatArray], whole_plot: IntArray | None = None
) -> dict[str, float]:
    """Variance inflation factor of every column but the constant: 1 / (1 - R^2) on all the others, centred.

    Variables are coded to -1 to 1 over their range first, as usual: otherwise the factor of T would depend on the
    distance of 0 degC from the data. Without categories.

    Args:
        formula: the terms.
        table: (n,) arrays by name.
        whole_plot: (n,) identities, to include an indicator for every whole plot.

    Raises:
        RankError: with indicators, terms are constant within whole plots (but for readback noise); or the columns
            depend on each other.
    """
    coded = {name: _coded(name, table[name]) for name in formula.names}
    names, columns = formula.without(Term()).columns(coded)
    centred = columns - columns.mean(axis=0)
    nuisance = np.ones((len(columns), 1))
    if whole_plot is not None:
        constant = [str(term) for term in formula.terms if len(term) and of_whole_plot(term)]
        if constant:
            raise RankError(
                f"with an indicator for every whole plot these cannot be estimated: {', '.join(constant)}; "
                "they are constant within whole plots"
            )
        identities, index = np.unique(whole_plot, return_inverse=True)
        nuisance = np.eye(len(identities))[index]
    free = columns - nuisance @ np.linalg.lstsq(nuisance, columns, rcond=None)[0]
    r = np.linalg.qr(free / np.linalg.norm(centred, axis=0), mode="r")
    if np.any(np.abs(np.diag(r)) < _ALIKE):
        at = int(np.argmax(np.abs(np.diag(r)) < _ALIKE))
        raise RankError(f"{names[at]} depends on the columns before it: {', '.join(names[:at])}")
    inverse = np.linalg.inv(r)
    return dict(zip(names, np.sum(inverse**2, axis=1).tolist(), strict=True))


def _parse(text: str) -> Formula:
    for column, name in _SHORT.items():
        text = re.sub(rf"\b{column}\b", name, text)
    return Formula.parse(text)


def _coded(name: str, values: FloatArray) -> FloatArray:
    low, high = float(values.min()), float(values.max())
    if high == low:
        raise RankError(f"{name} has one value, {low:g}, throughout")
    return (2.0 * values - low - high) / (high - low)


def _powers(term: Term) -> Counter[str]:
    """Exponents by variable; a factor that is not a power of a variable counts as a variable itself."""
    powers: Counter[str] = Counter()
    for factor in term.factors:
        name, power = _power(factor)
        powers[name] += power
    return powers


def _power(factor: Factor) -> tuple[str, int]:
    if isinstance(factor, Numeric) and factor.expression.operation == "^":
        base, exponent = factor.expression.of
        if base.operation == "name" and exponent.operation == "number" and exponent.of[0] == int(exponent.of[0]):
            return str(base), int(exponent.of[0])
    return factor.text, 1


_UNITS = {"P": "psi", "T_sensor": "degC", "T_SSE": "degC"}


def coefficient_unit(term: str) -> str:
    """Unit of a term's coefficient: "mV/psi/degC" of "P:T_sensor", "mV per unit" for other functions."""
    if term == "1":
        return "mV"
    unit = "mV"
    for factor in term.split(":"):
        name, _, power = factor.partition("^")
        if name not in _UNITS or not (power or "1").isdigit():
            return "mV per unit"
        unit += f"/{_UNITS[name]}" + (f"^{power}" if power else "")
    return unit
