"""A general run as it is planned: the outputs that its procedure expects, with the expected scatter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.column_names import stem_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import Expected
from rig.procedures.general.planning import formulas_of
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.plan.run_list import RunList
from rig.procedures.tables.table import Table

_SEED = 20260115


def expected_run(procedure: GeneralProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
    """The run as planned, for a forecast: of the sensors whose output and scatter `[expect]` has.

    Raises:
        DataError: it has those of none, an output is not one of the factors alone, or a model is not.
    """
    expect, names = procedure.expect, [factor.name for factor in run_list.factors]
    known = {stem_of(column): column for column in sensors}
    every = formulas_of(procedure).values()
    read = list(dict.fromkeys(name for formula in every for name in formula.names if name not in names))
    if read:
        raise DataError(f"{', '.join(read)} of the model is only known when it is read")
    told = [name for name in known if name in expect.output and name in expect.sigma]
    if not told:
        has: dict[str, Mapping[str, object]] = {"output": expect.output, "sigma": expect.sigma}
        lacks = (f"{one}: no {' and no '.join(k for k, v in has.items() if one not in v)}" for one in known)
        raise DataError(
            f"[expect] has not both, output and sigma, of a sensor ({'; '.join(lacks)}): with them a total uncertainty "
            f"is promised, as in output = {{ {next(iter(known))} = '0.1 + 0.5*{names[0]}' }}"
        )
    columns: dict[str, FloatArray] = {name: np.array(run_list.column(name), np.float64) for name in names}
    n = len(run_list)
    plots = np.array([point.whole_plot for point in run_list.points]) if run_list.whole_plots else None
    noise = _Noise(columns, plots, expect.whole_plot_ratio)
    outputs = {}
    for name in told:
        ideal = _ideal(f"expect.output.{name}", expect.output[name], columns, n)
        formula = formulas_of(procedure).get(name if name in procedure.model.own else "")
        fitted = None if formula is None or formula.has_categories else formula.columns(columns)[1]
        outputs[known[name]] = ideal + expect.sigma[name] * noise.of(fitted)
    table_columns = {
        "replicate": np.array([point.replication for point in run_list.points], np.float64),
        "order": np.arange(1.0, n + 1.0),
        "elapsed_s": np.arange(float(n)),
        **({} if plots is None else {"whole_plot": plots.astype(np.float64)}),
        **columns,
        **outputs,
    }
    table = Table(
        "the plan",
        table_columns,
        True,
        {},
        declared=procedure.model.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
        kind="general",
        outputs={known[name]: name for name in told},
        factors=tuple(names),
    )
    return Expected(table, meter=True, assuming="; ".join(_words(procedure, told, known)))


def _ideal(where: str, text: str, columns: Mapping[str, FloatArray], n: int) -> FloatArray:
    try:
        expression = parse_expression(text)
    except FitError as error:
        raise DataError(f"{where}: {error}") from error
    other = [name for name in expression.names if name not in columns]
    if other:
        raise DataError(f"{where}: {other[0]} is not a factor ({', '.join(columns)})")
    values = np.broadcast_to(np.asarray(expression.value(columns), np.float64), (n,))
    if not np.isfinite(values).all():
        raise DataError(f"{where}: it has no value at a setting of the plan")
    return values


class _Noise:
    """Scatter of observations in units of its standard deviation, always the same."""

    def __init__(self, columns: Mapping[str, FloatArray], plots: FloatArray | None, ratio: float) -> None:
        self._rng = np.random.default_rng(_SEED)
        self._n = len(next(iter(columns.values())))
        self._plots, self._ratio = plots, ratio

    def of(self, fitted: FloatArray | None) -> FloatArray:
        """(n,) of one sensor: a fit of its model, with (n, k) columns, has the declared standard deviations exactly."""
        basis = np.ones((self._n, 1)) if fitted is None else fitted
        if self._plots is not None and len(set(self._plots.tolist())) < self._n:
            design = SplitPlotDesign(basis, self._plots, [f"c{k}" for k in range(basis.shape[1])])
            return design.expected_errors(self._ratio**2, self._rng)
        noise = self._rng.normal(size=self._n)
        left = noise - basis @ np.linalg.lstsq(basis, noise, rcond=None)[0]
        return np.asarray(left * np.sqrt(max(self._n - basis.shape[1], 1)) / np.linalg.norm(left))


def _words(procedure: GeneralProcedure, told: list[str], known: Mapping[str, str]) -> Iterator[str]:
    each = (f"{name} = {procedure.expect.output[name]} with sd {procedure.expect.sigma[name]:g}" for name in told)
    yield f"outputs as expected, {'; '.join(each)} ([expect])"
    if any(factor.hard for factor in procedure.factors.values()):
        yield f"errors of whole plots {procedure.expect.whole_plot_ratio:g} times as large (expect.whole_plot_ratio)"
    left = [name for name in known if name not in told]
    if left:
        yield f"{', '.join(left)} without a forecast: expect.output and expect.sigma have not both"
