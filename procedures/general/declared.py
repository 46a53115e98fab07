"""The declared models of a general procedure before the run: what the design can estimate, and how precisely."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.errors import FitError
from fitter.formula import Formula
from fitter.split_plot import plan_precision
from procedures.advice import Advice
from procedures.general.settings import GeneralProcedure
from procedures.precision import Precision
from procedures.run_list import RunList

_DEPENDENT = 1e-9
"""A column counts as a combination of others if less than this fraction of its length is its own."""
_NEAR = 0.95
"""Correlation of two terms above which they can hardly be told apart."""


def settings_of(run_list: RunList) -> dict[str, FloatArray]:
    """(n,) setpoints of every factor."""
    return {factor.name: np.array(run_list.column(factor.name)) for factor in run_list.factors}


def formulas_of(procedure: GeneralProcedure) -> Mapping[str, Formula]:
    """Declared models by the sensor's name; "" for those without one of their own.

    Raises:
        FitError: a formula violates the grammar, or has variables that are not factors.
    """
    found = {}
    for sensor, text in {"": procedure.model.formula, **procedure.model.own}.items():
        where = f"model.{sensor}.formula" if sensor else "model.formula"
        try:
            formula = Formula.parse(text)
        except FitError as error:
            raise FitError(f"{where}: {error}") from None
        unknown = [name for name in formula.names if name not in procedure.factors]
        if unknown and not unknown[0].endswith("_degC"):  # a temperature that the bench reads may be in the model
            raise FitError(
                f"{where}: {unknown[0]} is not a factor ({', '.join(procedure.factors)}); a model is of factors, and "
                f"of temperatures that the bench reads"
            )
        if not formula.terms:
            raise FitError(f"{where}: it has no terms: there is nothing to fit")
        found[sensor] = formula
    return found


def check_declared(procedure: GeneralProcedure, run_list: RunList) -> None:
    """Refuse a design that cannot estimate a declared model.

    Raises:
        FitError: with the terms that cannot be estimated, and what would estimate them.
    """
    settings = settings_of(run_list)
    for sensor, formula in formulas_of(procedure).items():
        if not set(formula.names) <= settings.keys():
            continue  # of a temperature, which is only known when it has been read
        names, columns = formula.columns(settings)
        lost = dependent(columns)
        if lost:
            of = f" of {sensor}" if sensor else ""
            terms = " and ".join(names[i] for i in lost)
            raise FitError(
                f"the design cannot estimate the declared model{of} ({formula}): {terms} cannot be told from the other "
                f"terms; {_remedy(formula, [names[i] for i in lost], settings)}"
            )


def dependent(columns: FloatArray) -> list[int]:
    """Columns (n, k) that are combinations of those before them."""
    length = np.linalg.norm(columns, axis=0)
    basis, lost = np.empty((len(columns), 0)), []
    for i in range(columns.shape[1]):
        own = columns[:, i] / (length[i] or 1.0)
        for _ in range(2):
            own = own - basis @ (basis.T @ own)
        rest = float(np.linalg.norm(own))
        if not length[i] or rest < _DEPENDENT:
            lost.append(i)
        else:
            basis = np.column_stack([basis, own / rest])
    return lost


def _remedy(formula: Formula, lost: list[str], settings: Mapping[str, FloatArray]) -> str:
    """What would estimate the terms."""
    concerned = dict.fromkeys(name for term in formula.terms if str(term) in lost for name in term.names)
    few = [f"{name} ({len(np.unique(settings[name]))} levels)" for name in concerned or settings]
    return f"set more levels of {' or '.join(few)}, in combinations that vary independently, or leave the term out"


def _plots(run_list: RunList) -> IntArray | None:
    return np.array([p.whole_plot for p in run_list.points]) if run_list.whole_plots else None


def _covariance(
    columns: FloatArray, names: tuple[str, ...], plots: IntArray | None, ratio: float
) -> tuple[FloatArray, FloatArray]:
    """(k, k) covariance of the coefficients and (k,) degrees of freedom, for an error of one observation of 1."""
    if plots is None:
        r = np.linalg.qr(columns, mode="r")
        root = np.linalg.inv(r)
        return root @ root.T, np.full(len(names), float(len(columns) - len(names)))
    found = plan_precision(columns, plots, ratio, 1.0, names)
    return found.covariance, found.df


def precision(procedure: GeneralProcedure, run_list: RunList) -> Precision:
    """Standard error of every coefficient, and of the fitted value over the design."""
    settings, plots = settings_of(run_list), _plots(run_list)
    expect, rows, further, cells = procedure.expect, [], [], []
    formulas = formulas_of(procedure)
    names = [*dict.fromkeys([*procedure.model.own, *expect.sigma])] or [""]
    for sensor in names:
        formula = formulas.get(sensor, formulas[""])
        if not set(formula.names) <= settings.keys():
            further.append(f"{sensor or 'the model'}: its precision depends on temperatures that are read in the run")
            continue
        sigma = expect.sigma.get(sensor)
        terms, columns = formula.columns(settings)
        covariance, df = _covariance(columns, terms, plots, expect.whole_plot_ratio)
        for i, term in enumerate(terms):
            sd = float(np.sqrt(covariance[i, i])) * (sigma or 1.0)
            known = float(df[i]) if np.isfinite(df[i]) and df[i] > 0 else None
            rows.append({"sensor": sensor, "term": term, "sd": sd, "df": known})
            cells.append((sensor or "any", term, f"{sd:.3g}", "-" if known is None else f"{known:.0f}"))
        at = np.sqrt(np.einsum("ij,jk,ik->i", columns, covariance, columns)) * (sigma or 1.0)
        worst = {name: float(values[int(at.argmax())]) for name, values in settings.items()}
        where = ", ".join(f"{name} = {value:g}" for name, value in worst.items())
        unit = "its unit" if sigma else "standard errors of one observation"
        who = sensor or "any sensor"
        further.append(f"{who}: the fitted value is known to {at.max():.3g} (sd, in {unit}) at worst, at {where}")
    told = ", ".join(f"{name} {value:g}" for name, value in expect.sigma.items())
    assumed = (
        f"with a standard deviation of one observation of {told}"
        if told
        else ("for a standard deviation of one observation of 1: expect.sigma says what it is, by sensor")
    )
    if plots is not None:
        assumed += f"; that between whole plots is {expect.whole_plot_ratio:g} times as large: expect.whole_plot_ratio"
    return Precision(("sensor", "term", "sd", "df"), rows, cells, assumed, tuple(further))


def advice(procedure: GeneralProcedure) -> list[Advice]:
    """Terms and effects that are confounded, and errors without degrees of freedom."""
    run_list = procedure.expand()
    settings, found = settings_of(run_list), []
    for sensor, formula in formulas_of(procedure).items():
        if not set(formula.names) <= settings.keys():
            continue
        names, columns = formula.columns(settings)
        of = f" of {sensor}" if sensor else ""
        left = len(columns) - len(names)
        if left <= 0:
            found.append(
                _bad(
                    "errors",
                    f"the model{of} has as many coefficients as points ({len(names)}): no error can "
                    "be estimated; add replications",
                )
            )
        pure = len(columns) - len({tuple(p.setpoints) for p in run_list.points})
        if not pure:
            found.append(
                _bad(
                    "repeats",
                    "no setting is visited twice: scatter and lack of fit cannot be told apart; add replications",
                )
            )
        found += [_bad("apart", said) for said in _alike(names, columns, of)]
        found += [_bad("curvature", said) for said in _curvature(formula, settings, of)]
    found += _of_order(procedure, run_list)
    return list(dict.fromkeys(found))


def _bad(what: str, sentence: str) -> Advice:
    return Advice(0, what, False, sentence)


def _alike(names: tuple[str, ...], columns: FloatArray, of: str) -> list[str]:
    """Pairs of terms that vary nearly together."""
    own = columns - columns.mean(axis=0)
    length = np.linalg.norm(own, axis=0)
    told = []
    for i in range(len(names)):
        for j in range(i):
            if length[i] and length[j]:
                r = float(own[:, i] @ own[:, j] / length[i] / length[j])
                if abs(r) > _NEAR and not (set(names[i].split("^")) & set(names[j].split("^"))):
                    told.append(
                        f"{names[j]} and {names[i]}{of} vary nearly together (correlation {r:.2f}): their "
                        "coefficients will be known poorly each"
                    )
    return told


def _curvature(formula: Formula, settings: Mapping[str, FloatArray], of: str) -> list[str]:
    """Factors with so few levels that nothing beyond the model could be seen."""
    told = []
    for name in formula.names:
        levels = len(np.unique(settings[name]))
        alone = [term for term in formula.terms if set(term.names) == {name}]
        if 1 < levels <= len(alone) + 1:
            told.append(
                f"{name} has {levels} levels, and the model{of} has {len(alone)} terms in it: a curve beyond "
                "the model could not be seen"
            )
    return told


def _of_order(procedure: GeneralProcedure, run_list: RunList) -> list[Advice]:
    """Orders that confound an effect with time."""
    told: list[Any] = []
    if procedure.replications == 1:
        for name, factor in procedure.factors.items():
            if factor.order == "as written" and not factor.hard and len(run_list.levels(run_list.factor(name))) > 2:
                told.append(
                    _bad(
                        "order",
                        f"{name} is set in one order, once: its effect and a drift look alike; use "
                        'order = "up-down" or "random", or replications',
                    )
                )
    for stiff in run_list.hard:
        plots = {(p.whole_plot, run_list.setting(p)[stiff.name]) for p in run_list.points}
        levels = len({level for _, level in plots})
        if len(plots) == levels:
            told.append(
                _bad(
                    "whole plots",
                    f"every {stiff.name} has one whole plot: how much whole plots differ "
                    "cannot be estimated from repeats; add replications",
                )
            )
    return told
