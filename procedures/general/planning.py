"""The declared models of a general procedure before the run: what the design can estimate, and how precisely."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.designs import Evaluation, evaluate
from rig.fitter.designs.advice import advice as of_design
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.split_plot import plan_precision
from rig.procedures.general.factors import AS_WRITTEN, DEGC
from rig.procedures.general.model_settings import SensorModel
from rig.procedures.general.models.named import standard_model
from rig.procedures.general.models.units import unit_in
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.general.swept import swept
from rig.procedures.plan.advice import Advice
from rig.procedures.plan.expected import Columns
from rig.procedures.plan.precision import Precision
from rig.procedures.plan.run_list import RunList

_MOST_SHOWN = 4
_NAME = re.compile(r"[A-Za-z]\w*")


def formulas_of(procedure: GeneralProcedure) -> Mapping[str, Formula]:
    """Declared formulas by the sensor's name; "" for those without one of their own.

    Raises:
        FitError: a formula violates the grammar, has variables that are not factors, or a standard model is not known.
    """
    found = {}
    for sensor, model in {"": procedure.model, **procedure.model.own}.items():
        where, text = f"model.{sensor}.formula" if sensor else "model.formula", model.formula
        if model.standard is not None:
            standard_model(model.standard)
            _check_abscissa(sensor, model, procedure)
        if text is None or not model.linear:
            continue
        try:
            formula = Formula.parse(text)
        except FitError as error:
            raise FitError(f"{where}: {error}") from None
        unknown = [name for name in formula.names if name not in procedure.factors]
        if unknown and "_" not in unknown[0]:  # what the bench reads, in its unit, may be in the model
            raise FitError(
                f"{where}: {unknown[0]} is not a factor ({', '.join(procedure.factors)}); a model is of factors, and "
                f"of what the bench reads; parameters have start values, start = {{ {unknown[0]} = 1 }}"
            )
        if not formula.terms:
            raise FitError(f"{where}: it has no terms: there is nothing to fit")
        found[sensor] = formula
    return found


def _check_abscissa(sensor: str, model: SensorModel, procedure: GeneralProcedure) -> None:
    """Refuse a standard model whose factor is not known. Raises `FitError`."""
    factors = list(procedure.factors)
    where = f"model.{sensor}" if sensor else "model"
    if model.abscissa is None and len(factors) > 1:
        raise FitError(f"{where}.standard = {model.standard!r}: abscissa has to say the factor, {' or '.join(factors)}")
    if model.abscissa is not None and model.abscissa not in factors:
        raise FitError(f"{where}.abscissa = {model.abscissa!r} is not a factor ({', '.join(factors)})")


def evaluations(procedure: GeneralProcedure, run_list: RunList) -> Iterator[tuple[str, Formula, Evaluation]]:
    """Every declared model of factors alone, by sensor, and what the run list determines of it.

    Raises:
        FitError: a formula cannot be used.
    """
    names = [factor.name for factor in run_list.factors]
    points = np.array([run_list.column(name) for name in names]).T
    shared = 0 < run_list.whole_plots < len(run_list)  # a whole plot of one point has no error of its own
    plots = np.array([p.whole_plot for p in run_list.points]) if shared else None
    for sensor, formula in formulas_of(procedure).items():
        if formula.has_categories or not set(formula.names) <= set(names):
            continue  # of a temperature, which is only known when it has been read

        def columns(given: FloatArray, formula: Formula = formula) -> FloatArray:
            return formula.columns(dict(zip(names, given.T, strict=True)))[1]

        terms, _ = formula.columns(dict(zip(names, points.T, strict=True)))
        levels = [np.unique(points[:, at]) for at in range(len(names))]
        eta = procedure.expect.whole_plot_ratio**2
        yield sensor, formula, evaluate(points, levels, columns, terms, whole_plot=plots, eta=eta)


def check_declared(procedure: GeneralProcedure, run_list: RunList) -> None:
    """Refuse a design that cannot estimate a declared model.

    Raises:
        FitError: with the terms that cannot be estimated, and points that would estimate them.
    """
    for sensor, formula, found in evaluations(procedure, run_list):
        if not found.undetermined:
            continue
        of = f" of {sensor}" if sensor else ""
        names = [factor.name for factor in run_list.factors]
        points = [
            ", ".join(f"{name} = {value:g}" for name, value in zip(names, point, strict=True))
            for point in found.would[:_MOST_SHOWN].tolist()
        ]
        would = f"; these points would determine them: {'; '.join(points)}" if points else ""
        raise FitError(
            f"the design cannot estimate the declared model{of} ({formula}): it does not determine "
            f"{', '.join(found.undetermined)}{would}; or leave terms out"
        )


def _why_not(procedure: GeneralProcedure, sensor: str, run_list: RunList) -> str:
    """Why no precision of a model is predicted, as the end of a sentence."""
    own = procedure.model.own
    formula = formulas_of(procedure).get(sensor if sensor in own else "")
    if formula is None:
        return (
            "its model is not linear in its coefficients, so their errors depend on their values; expect.output and "
            "a register of equipment give total uncertainties (docs/how_to/register.md)"
        )
    read = [name for name in formula.names if name not in {factor.name for factor in run_list.factors}]
    if not read:
        return "its model has texts or levels that are only known when they are recorded"
    told = f"{', '.join(read)} of its model {'is' if len(read) == 1 else 'are'} only known when read"
    if any(name.endswith(DEGC) for name in read):
        return told
    return (
        f"{told}; levels of {', '.join(read)} with a table of approach would be known before (docs/how_to/general.md)"
    )


def precision(procedure: GeneralProcedure, run_list: RunList) -> Precision:
    """Standard error of every coefficient, and of the fitted value over the design."""
    expect, rows, further, cells = procedure.expect, [], [], []
    unknown: dict[str, list[str]] = {}
    models = {sensor: (formula, found) for sensor, formula, found in evaluations(procedure, run_list)}
    for sensor in [*dict.fromkeys([*procedure.model.own, *expect.sigma])] or [""]:
        formula, found = models.get(sensor if sensor in procedure.model.own else "", (None, None))
        if formula is None or found is None:
            unknown.setdefault(_why_not(procedure, sensor, run_list), []).append(sensor or "the model")
            continue
        sigma, who = expect.sigma.get(sensor), sensor or "any sensor"
        for term, relative, df in zip(found.names, found.stderr.tolist(), _freedom(found), strict=True):
            known = float(df) if np.isfinite(df) and df > 0 else None
            sd = None if sigma is None else relative * sigma
            rows.append({"sensor": sensor, "term": term, "sd": sd, "sd_over_scatter": relative, "df": known})
            if sd is not None:
                cells.append((sensor, term, f"{sd:.3g}", "-" if known is None else f"{known:.0f}"))
        settings = found.region.settings
        variance = found.variance(settings)
        at = zip(procedure.factors, settings[ties.highest(variance, 0.0)].tolist(), strict=True)
        where = ", ".join(f"{name} = {value:g}" for name, value in at)
        mean, worst = ((value**0.5) * (sigma or 1.0) for value in (found.mean_variance, float(variance.max())))
        if sigma is None:
            further.append(
                f"{who}: no precision is predicted: its scatter is not known. [expect] states it, as in "
                f"sigma = {{ {sensor or 'SENSOR'} = 0.002 }}. By the design alone the fitted value has {mean:.2g} of "
                f"that scatter on average, and {worst:.2g} of it at {where}"
            )
        else:
            further.append(f"{who}: the fitted value has an sd of {mean:.3g} on average, and of {worst:.3g} at {where}")
    further += [f"{', '.join(sensors)}: no precision is predicted: {why}" for why, sensors in unknown.items()]
    told = ", ".join(f"{name} {value:g}" for name, value in expect.sigma.items())
    assumed = f"for a standard deviation of one observation of {told}: expect.sigma" if cells else ""
    if rows and 0 < run_list.whole_plots < len(run_list):
        ratio = f"that between whole plots is {expect.whole_plot_ratio:g} times as large: expect.whole_plot_ratio"
        assumed = f"{assumed}; {ratio}" if assumed else ratio
    return Precision(("sensor", "term", "sd", "df"), rows, cells, assumed, tuple(further))


def _freedom(found: Evaluation) -> FloatArray:
    """(p,) degrees of freedom of the coefficients' standard errors."""
    if found.whole_plot is None:
        return np.full(len(found.names), float(found.freedom.residual))
    columns = found.region.raw(found.points)
    return plan_precision(columns, found.whole_plot, found.eta**0.5, 1.0, found.names).df


def advice(procedure: GeneralProcedure) -> list[Advice]:
    """Terms and effects that are confounded, and errors without degrees of freedom."""
    run_list = procedure.expand()
    told: dict[str, None] = {}
    for sensor, _, found in evaluations(procedure, run_list):
        of = f"{sensor}: " if sensor else ""
        told |= dict.fromkeys(f"{of}{sentence}" for sentence in of_design(found, list(procedure.factors)))
    every = (*_of_order(procedure, run_list), *_of_nothing(procedure, run_list), *_not_inferred(procedure))
    told |= dict.fromkeys(every)
    return [Advice(0, "design", False, sentence) for sentence in told]


def _of_order(procedure: GeneralProcedure, run_list: RunList) -> Iterator[str]:
    """Orders that confound an effect with time."""
    places = np.arange(float(len(run_list)))
    for name, factor in procedure.factors.items():
        once = procedure.replications == 1 and factor.order == AS_WRITTEN and not factor.hard
        column = run_list.column(name)
        again = len(list(itertools.groupby(column))) > len(set(column))
        if swept(np.array(column), places):
            yield (
                f"{name} changes in one direction only: its effect and a drift of any shape look alike; use "
                f'order = "up-down" or "random", or replications'
            )
        elif once and not again and len(set(column)) > 2:
            yield (
                f"{name} is set in one order, once: its effect and a drift look alike; use "
                f'order = "up-down" or "random", or replications'
            )


def _not_inferred(procedure: GeneralProcedure) -> Iterator[str]:
    """Models of several variables that do not say which of them a reading determines; once for equal ones."""
    models: dict[str, SensorModel] = {"": procedure.model, **procedure.model.own}
    sensors: dict[tuple[str, ...], list[str]] = {}
    for sensor, formula in formulas_of(procedure).items():
        names = tuple(formula.names)
        if len(names) > 1 and models[sensor].abscissa is None and len(procedure.factors) > 1:
            sensors.setdefault(names, []).append(sensor)
    for names, every in sensors.items():
        of = f"{', '.join(every)}: " if any(every) else ""
        yield (
            f"{of}budgets and certificates will state outputs and no inferred values: the model has "
            f'{", ".join(names)}, and abscissa = "{names[0]}" in [model] would say that a reading determines that one'
        )


def _of_nothing(procedure: GeneralProcedure, run_list: RunList) -> Iterator[str]:
    """Factors that are varied and in no sensor's model."""
    models: list[SensorModel] = [procedure.model, *procedure.model.own.values()]
    named = {name for one in models for name in _NAME.findall(one.formula or "")}
    named |= {one.abscissa or next(iter(procedure.factors)) for one in models if one.standard is not None}
    linear = [Formula.parse(one.formula) for one in models if one.linear and one.formula]
    read = {name for formula in linear for name in formula.names} - procedure.factors.keys()
    reads = any(name.endswith(DEGC) for name in read)
    sets = any(not name.endswith(DEGC) for name in read)  # and the bench says which factor sets it
    for factor in run_list.factors:
        values = run_list.column(factor.name)
        if factor.name in named or len(set(values)) < 2 or (reads and factor.name.endswith(DEGC)):
            continue  # a thermometer in the model may be one that follows it
        if sets and not procedure.factors[factor.name].hard:
            continue
        others = [name for formula in linear for name in formula.names if name != factor.name]
        of_slope = f", and `+ {factor.name}:{others[0]}` that on the sensitivity" if others else ""
        yield (
            f"{factor.name} is varied and in no sensor's model: its influence, if any, goes into the residual, and "
            f"calibrations hold at its mean, {sum(values) / len(values):.4g} {unit_in(factor.name)}; "
            f"`+ {factor.name}` in model.formula estimates that on the offset{of_slope}"
        )


def model_columns(columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
    """Columns of the declared model, for the residuals of a running run."""
    if not declared.get("formula") or declared.get("start"):
        return None
    formula = Formula.parse(str(declared["formula"]))
    if formula.has_categories or not set(formula.names) <= columns.keys():
        return None
    return formula.columns(columns)[1]
