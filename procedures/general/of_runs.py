"""Fits and traces of runs of kind "general": every sensor, by the declared model of the procedure."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.steps import steps
from rig.fitter.trace.outcome import Outcome
from rig.procedures.column_names import moves_of, read_at, spelled, split_unit, unit_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict
from rig.procedures.evaluate.results import Page, PlainFitted
from rig.procedures.evaluate.trace_shown import in_full
from rig.procedures.general.as_read_back import as_read_back
from rig.procedures.general.column_roles import Roles
from rig.procedures.general.common import Common, common_of
from rig.procedures.general.declared import Declared
from rig.procedures.general.evaluate import IGNORED, GeneralTraced, trace_general_table
from rig.procedures.general.fit import fit_general
from rig.procedures.general.model_settings import ModelSettings, SensorModel
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.general.shown import show_general_fit
from rig.procedures.present.blocks import Block
from rig.procedures.tables.moving import sentences
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import RECORDED

_WHOLE_PLOT, _REPLICATE, _TIME, _BLOCK = "whole_plot", "replicate", "elapsed_s", "block"
_LEFT_OUT = "and is evaluated without them"
_FLAGS = {
    "missing": "since a channel failed",
    "reference": "since the reference standard read something else than was set",
    "noisy": "as noisier than the procedure allows",
    "contradictory": "since its readings contradict one another",
    "frozen": "since an output repeated itself to the last digit",
    "temperature": "since the environment had left its tolerance",
    "overshot": "since its setting had gone beyond the level and was approached again, from the planned side",
}
_NOT_TRACED = ("run_index", "order", "accepted", "simulated")


def models_of(table: Table) -> Mapping[str, SensorModel]:
    """Declared model of every output of a run. Raises `DataError` if the run declares none."""
    try:
        declared = {k: v for k, v in table.declared.items() if v is not None and k != "temperature"}
        model = ModelSettings.model_validate(declared)
    except ValueError as error:
        raise DataError(f"{table.source}: its procedure declares no model: [model] formula") from error
    return {column: model.of(sensor) for column, sensor in table.outputs.items()}


@dataclass(frozen=True)
class RunModels:
    """A run, and the declared models of the sensors that are to be fitted or traced.

    Attributes:
        table: the run.
        models: by output.
    """

    table: Table
    models: Mapping[str, SensorModel]

    @classmethod
    def of(cls, table: Table, response: str | None = None, formula: str | None = None) -> RunModels | None:
        """With the procedure's models; or one output only, or another formula for it or for all.

        None if the response is no output: arithmetic, or another column. Raises `DataError` if there is no model.
        """
        if response is not None and response not in table.outputs:
            if formula is None:
                raise DataError(
                    f"{table.source} has no output {response}; its sensors are {', '.join(table.outputs)}, and any "
                    f"other column needs --formula, too"
                )
            return None
        wanted = [response] if response is not None else list(table.outputs)
        if formula is not None:
            return cls(table, dict.fromkeys(wanted, SensorModel(formula=formula)))
        models = models_of(table)
        return cls(table, {output: models[output] for output in wanted})

    def adding(self, terms: Mapping[str, Sequence[str]]) -> RunModels:
        """These models with further terms, by output."""
        return RunModels(self.table, {name: _with_terms(one, terms.get(name, ())) for name, one in self.models.items()})


def reader_of(table: Table) -> Reader:
    """Reads a table that is read already."""

    def read(needed: Collection[str]) -> Table:
        for name in needed:
            if name not in table.columns:
                raise DataError(f"{table.source} has no column {name} (columns: {', '.join(table.columns)})")
        lacks = [name for name in without_readings(table) if name in needed]
        return with_readings_of(table, lacks) if lacks else table

    return read


def without_readings(table: Table) -> dict[str, str]:
    """By output, that its channel failed in some of the rows of a run, in words; {} where none has."""
    found = {}
    for output in table.outputs:
        values = table.columns.get(output, np.empty(0))
        if count := int(np.count_nonzero(~np.isfinite(values))):
            found[output] = f"{output} has no reading in {count} of {len(table)} rows"
    return found


def with_readings_of(table: Table, outputs: Sequence[str]) -> Table:
    """The rows of a run that have readings of these outputs. Raises `DataError` if none has."""
    kept = np.flatnonzero(np.all([np.isfinite(table.columns[name]) for name in outputs], axis=0))
    if not kept.size:
        raise DataError(f"{table.source}: no row has readings of {' and '.join(outputs)}")
    columns = {name: values[kept] for name, values in table.columns.items()}
    return replace(table, columns=columns, rows=tuple(table.numbers[kept].tolist()), within={})


def declared_of(model: SensorModel, table: Table) -> Declared:
    """A model as tables of any kind declare it."""
    only = table.factors[0] if len(table.factors) == 1 else None
    abscissa = (model.abscissa or only) if model.standard is not None else None
    start = tuple(f"{name}={value!r}" for name, value in model.start.items())
    return Declared(model.formula, model.standard, abscissa, start)


def _with_terms(model: SensorModel, terms: Sequence[str]) -> SensorModel:
    return model.model_copy(update={"formula": " + ".join([str(model.formula), *terms])}) if terms else model


def recorded(table: Table) -> tuple[str, ...]:
    """Quantities recorded beside the factors of a run, such as temperatures, which readings in use may have, too."""
    known = {*table.factors, *table.outputs, _WHOLE_PLOT, _REPLICATE, _TIME, _BLOCK}
    return tuple(
        name for name in table.columns if name not in known and not name.endswith("_side") and not _ignored(name, table)
    )


def has_whole_plots(table: Table) -> bool:
    """Whether readings share whole plots; a whole plot of one reading has no error of its own beside that reading's."""
    plots = table.columns.get(_WHOLE_PLOT)
    return plots is not None and len(set(plots.tolist())) < len(plots)


def notes_of(table: Table) -> tuple[str, ...]:
    """Sentences on a run that belong to every result of it."""
    told = []
    if _WHOLE_PLOT in table.columns and not has_whole_plots(table):
        told.append("every whole plot has one reading: its error is a part of that of the row, and was not separated")
    told += [f"{failed}, {_LEFT_OUT}" for failed in without_readings(table).values()]
    flags: Mapping[str, int] = table.provenance.get("flags", {})
    for flag, count in flags.items():
        rows = "1 row is" if count == 1 else f"{count} rows are"
        told.append(f"{rows} flagged {_FLAGS.get(flag, flag)}; `rig export --all` and the run's events say which")
    return tuple(told)


def _noted(result: dict[str, Any], notes: Sequence[str]) -> dict[str, Any]:
    return {**result, "notes": [*result["notes"], *notes]}


@dataclass(frozen=True)
class RunFitted(PlainFitted):
    """Fits of all sensors of a run, as JSON values; a run of one sensor has the result of a table."""

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""

        for one in results_of(self.result).values():
            yield from show_general_fit(self.result["data"]["file"], one)


def results_of(result: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """Result of each output, from the JSON of a fit."""
    sensors: Mapping[str, Mapping[str, Any]] | None = result.get("sensors")
    return {result["response"]: result} if sensors is None else sensors


def noted_of(fitted: RunFitted, notes: Mapping[str, Sequence[str]]) -> RunFitted:
    """Fits with more notes, by output; every use of the calibrations has them too."""
    found = {}
    for output, one in results_of(fitted.result).items():
        more = list(notes.get(output, ()))
        kept = {**one["calibration"], "notes": [*one["calibration"]["notes"], *more]}
        found[output] = _noted({**one, "calibration": kept}, more)
    if "sensors" in fitted.result:
        return RunFitted({**fitted.result, "sensors": found})
    return RunFitted(next(iter(found.values())))


def fit_run(asked: RunModels, leave_out: Sequence[str] = (), at: Sequence[Mapping[str, float]] = ()) -> RunFitted:
    """Fit the declared model to every sensor, and predict its output at points.

    Raises:
        DataError: the rows do not determine a model, or it cannot be read.
    """
    table = asked.table
    plots = [_WHOLE_PLOT] if has_whole_plots(table) else []
    read, notes = reader_of(table), notes_of(table)
    found = {}
    for column in steps([*asked.models]):
        model = asked.models[column]
        declared = declared_of(model, table)
        one = fit_general(read, column, None, plots, None, leave_out, declared, at=at)
        moving = sentences(table.moving, column, table.factors).values()

        def fit(there: Table, column: str = column, declared: Declared = declared) -> dict[str, Any]:
            return fit_general(reader_of(there), column, None, plots, None, leave_out, declared, first_look=True)

        more = [*notes, *moving, *as_read_back(table, one, fit)]
        found[column] = _noted({**one, "data": {**one["data"], **table.provenance}}, more)
    if len(found) == 1:
        return RunFitted(next(iter(found.values())))
    first = next(iter(found.values()))
    unused = _unused_by_all([one["unused"] for one in found.values()], found)
    return RunFitted({"data": first["data"], "sensors": found, "unused": unused})


@dataclass(frozen=True, eq=False)
class RunTraced:
    """Traces of all sensors of a run.

    Attributes:
        each: by output.
        not_traced: outputs whose declared model is not linear in its coefficients.
    """

    each: Mapping[str, GeneralTraced]
    not_traced: tuple[str, ...] = ()

    @property
    def table(self) -> Table:
        """Source of the data."""
        return next(iter(self.each.values())).table

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """One outcome per sensor."""
        shared = {one.effect: one.sentence for one in self.common if one.same_in}
        return tuple(
            replace(
                one.outcome,
                findings=tuple(replace(f, shared=shared.get(f.effect, "")) for f in one.outcome.findings),
            )
            for one in self.each.values()
        )

    @cached_property
    def common(self) -> tuple[Common, ...]:
        """Effects that all sensors share."""
        return common_of(self.each)

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        told = [one.to_json() for one in self.each.values()]
        sensors = {name: found for one in told for name, found in one["sensors"].items()}
        together = told[0] | {"sensors": sensors, "unused": _unused_by_all([one["unused"] for one in told], sensors)}
        common = {"common": [one.to_json() for one in self.common]} if self.common else {}
        return together | common | ({"not_traced": list(self.not_traced)} if self.not_traced else {})

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return in_full(self)

    def page(self) -> Page:
        """The report of all sensors."""
        from rig.procedures.general.report import page_of  # noqa: PLC0415 - plots take a second to import

        common = [one.sentence for one in self.common]
        each = {one.outcome.sensor: one.trace for one in self.each.values()}
        return page_of(self, each, not_traced=list(self.not_traced), common=common)


def _unused_by_all(every: Sequence[Mapping[str, Any]], outputs: Collection[str]) -> dict[str, Any]:
    """Columns that the trace of no sensor used, and that are no sensor's output; from their `Unused.to_json`."""
    common = set.intersection(*({one["column"] for one in unused["columns"]} for unused in every))
    columns = [one for one in every[0]["columns"] if one["column"] in common and one["column"] not in outputs]
    told = [one | {"why": RECORDED if one["why"] == IGNORED else one["why"]} for one in columns]
    return {**every[0], "columns": told}


def trace_run(
    asked: RunModels, own: Laboratory = NOTHING, *, validate: bool = True, ignore: Sequence[str] = ()
) -> RunTraced:
    """Find effects missing in the declared model of every sensor; `own` is what the laboratory adds.

    Without the left-out error, if not `validate`; without what columns to `ignore` say.

    Raises:
        DataError: there are too few rows for a model, or it cannot be read.
    """
    read = reader_of(asked.table)
    every = {column: replace(roles, own=own) for column, roles in roles_of_run(asked, ignore).items()}
    found = {
        column: with_failures(trace_general_table(read, every[column], validate=validate), asked.table)
        for column in steps([*every])
    }
    return RunTraced(found, tuple(column for column in asked.models if column not in found))


def with_failures(traced: GeneralTraced, run: Table) -> GeneralTraced:
    """The trace of an output of a run, which says where its channel failed."""
    failed = without_readings(run).get(traced.roles.response)
    return traced if failed is None else replace(traced, taken=(*traced.taken, f"{failed}, {_LEFT_OUT}"))


def roles_of_run(asked: RunModels, ignore: Sequence[str] = ()) -> dict[str, Roles]:
    """Roles of the columns of a run in the trace of every output, but of columns to ignore.

    Raises:
        DataError: a declared model cannot be read.
    """
    table, models = asked.table, asked.models
    plots = has_whole_plots(table)
    found = {}
    if not any(model.linear for model in models.values()):
        raise DataError(
            f"{table.source}: a trace needs a formula that is linear in its coefficients, and the declared model is "
            f"not; `rig export` and `rig trace FILE --response ... --formula ...` trace against another one"
        )
    for column, model in models.items():
        formula = model.formula
        if formula is None or not model.linear:
            continue
        try:
            used = set(Formula.parse(formula).names)
        except FitError as error:
            raise DataError(f"{table.source}: the declared model of {column}: {error}") from error
        found[column] = Roles(
            column,
            formula,
            whole_plot=(_WHOLE_PLOT,) if plots else (),
            replicate=None if plots else _replicated(table),
            time=_TIME if _TIME in table.columns else None,  # a certificate's table may lack it
            direction=None if (side := _direction(table, used)) in ignore else side,
            ignore=tuple(dict.fromkeys([*ignore, *(name for name in table.columns if _ignored(name, table))])),
        )
    return {column: replace(roles, sensors=len(found)) for column, roles in found.items()}


def _replicated(table: Table) -> str | None:
    """The column of replications, if there are several."""
    values = table.columns.get(_REPLICATE)
    return _REPLICATE if values is not None and len(set(values.tolist())) > 1 else None


def _direction(table: Table, used: Collection[str]) -> str | None:
    """Column with the side of approach of a factor of the model; None if there is not exactly one that varies."""
    sides = [f"{name.rpartition('_')[0]}_side" for name in used]
    varying = [name for name in sides if name in table.columns and len(set(table.columns[name].tolist())) > 1]
    return varying[0] if len(varying) == 1 else None


def _ignored(name: str, table: Table) -> bool:
    """Whether a column says nothing beyond others: other outputs, setpoints and readbacks of measured factors."""
    stem, unit = split_unit(name)
    measured = stem.endswith("_set") and f"{stem.removesuffix('_set')}_{unit}" in table.columns
    doubled = measured or stem.endswith("_readback")
    moved = any(name in moves_of(factor) for factor in table.factors) or name in map(read_at, table.outputs)
    return name in _NOT_TRACED or name in table.outputs or name in table.set_in.values() or doubled or moved


def judge(procedure: GeneralProcedure, table: Table) -> list[Verdict]:
    """Every sensor with a limit: the standard deviation of one observation about the declared model; [] without one.

    Raises:
        DataError: a limit is of a sensor that the run does not have, or has no error to compare.
    """
    limits = procedure.acceptance.sigma_E or {}
    columns = {sensor: column for column, sensor in table.outputs.items()}
    unknown = sorted(limits.keys() - columns.keys())
    if unknown:
        raise DataError(f"acceptance.sigma_E.{unknown[0]}: the bench has no such sensor ({', '.join(columns)})")
    if not limits:
        return []
    results, verdicts = results_of(fit_run(RunModels(table, models_of(table))).result), []
    for sensor, limit in limits.items():
        column = columns[sensor]
        result, unit = results[column], spelled(unit_of(column))
        found = result.get("sigma_E") if "sigma_E" in result else result.get("sigma_subplot")
        if found is None:
            raise DataError(f"{column}: no error can be estimated, so acceptance.sigma_E cannot be judged")
        words = f"standard error of one observation up to {limit:g} {unit}"
        said = f"standard error of one observation {found:.3g} {unit}, limit {limit:g} {unit}"
        verdicts.append(Verdict(column, said, words, found <= limit))
    return verdicts
