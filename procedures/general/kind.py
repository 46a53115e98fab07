"""The kind "general"."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.general.options import BudgetOptions, FitOptions, InferOptions, TraceOptions
from rig.procedures.kind import Kind, lazily

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.procedures.evaluate.budgeting import Evaluation
    from rig.procedures.evaluate.confirming import Confirming
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.evaluate.results import Fitted, Options, Source, Traced
    from rig.procedures.general.evaluate import GeneralTraced
    from rig.procedures.general.infer import CurveCalibration
    from rig.procedures.general.of_runs import RunTraced
    from rig.procedures.general.settings import GeneralProcedure
    from rig.procedures.plan.advice import Advice
    from rig.procedures.tables.table import Reader, Table
    from rig.procedures.tables.within import Within


class GeneralKind(Kind):
    """Any table with a declared formula. See `rig.procedures.kind.Kind`."""

    name = "general"
    title = "any table"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    budget_options = BudgetOptions
    settings = lazily("settings:GeneralProcedure")
    own_effects = lazily("effects.own:GRAMMAR")
    explained = lazily("catalogue_shown:explained")
    look = lazily("likely:likely")
    expected = lazily("planned:expected_run")
    model_columns = lazily("planning:model_columns")
    check_design = lazily("planning:check_declared")
    precision = lazily("planning:precision")
    judge = lazily("of_runs:judge")
    charting = lazily("charting:GeneralCharting")
    cannot_confirm = lazily("confirming:cannot_confirm")
    further_runs = lazily("further_runs:further_runs")
    asked_by = frozenset({"response"})
    in_use = (
        "the response's column; the fitted curve is inverted where it rises or falls all the way, or in the range "
        "stated with --between"
    )
    described = "any other table is fitted with --response and --formula"

    def fit(
        self, source: Source, options: FitOptions, *, leave_out: Sequence[str], own: Laboratory, keep: bool
    ) -> Fitted:
        """A formula to one column, or the declared models to all sensors of a run."""
        from rig.procedures.evaluate.points import WITH_EFFECTS, points  # noqa: PLC0415

        read: Reader = source.read
        if source.is_run:
            from rig.procedures.general.of_runs import RunModels, fit_run, reader_of  # noqa: PLC0415

            asked = RunModels.of(source.table, options.response, options.formula)
            at = points(options.at or ())
            if asked is not None and options.traced and at:
                raise DataError(WITH_EFFECTS)
            if asked is not None and set(_given(options)) <= {*_OF_RUNS, "traced", "at", "ignore"}:
                if options.traced:
                    from rig.procedures.general.traced import fit_traced  # noqa: PLC0415

                    return fit_traced(asked, leave_out, own, _names(options.ignore))
                if options.ignore is None:
                    return fit_run(asked, leave_out, at)
            read = reader_of(source.table)
        if options.ignore is not None and not options.traced:
            raise DataError("--ignore is for a trace: with --traced or --confirmed-by, of a run")
        if options.traced:
            raise DataError(
                "--traced is for the sensors of a run file, with no other options than --response and --formula; of a "
                "table, add the terms that rig trace prints to --formula"
            )
        from rig.procedures.general.declared import Declared  # noqa: PLC0415
        from rig.procedures.general.fit import GeneralFitted, fit_general  # noqa: PLC0415
        from rig.procedures.general.series import series_of  # noqa: PLC0415

        if options.response is None:
            raise DataError(_NEEDS_RESPONSE.format(", ".join(f"--{n.replace('_', '-')}" for n in _given(options))))
        plots = [name.strip() for name in options.whole_plot.split(",")] if options.whole_plot else []
        declared = Declared(
            options.formula,
            options.model,
            options.abscissa,
            tuple(options.start or ()),
            options.weight,
            options.u_y,
            options.u_x,
            series_of(options.series, options.direction, options.position),
        )
        result = fit_general(
            read,
            options.response,
            None,
            plots,
            options.replicate,
            leave_out,
            declared,
            options.tolerance,
            between=options.between,
            at=points(options.at or ()),
        )
        return GeneralFitted(result)

    def evaluation(
        self, table: Table, options: BudgetOptions, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """Coefficients, outputs and inferred values of the sensors of a run."""
        from rig.procedures.general.for_budgets import general_evaluation  # noqa: PLC0415

        return general_evaluation(table, at, traced=options.traced, ignore=_names(options.ignore))

    def trace(self, source: Source, options: TraceOptions, *, own: Laboratory) -> Traced:
        """Find effects missing in the declared model; arguments and errors as for `fit`."""
        read: Reader = source.read
        if source.is_run:
            from rig.procedures.general.of_runs import RunModels, reader_of, trace_run, with_failures  # noqa: PLC0415

            asked = RunModels.of(source.table, options.response, options.formula)
            if asked is not None and set(_given(options)) <= {*_OF_RUNS, "ignore", "quick"}:
                return trace_run(asked, own, validate=not options.quick, ignore=_names(options.ignore))
            read = reader_of(source.table)
        from rig.procedures.general.column_roles import Roles  # noqa: PLC0415
        from rig.procedures.general.directions import read_direction  # noqa: PLC0415
        from rig.procedures.general.evaluate import trace_general_table  # noqa: PLC0415

        if options.response is None or options.formula is None:
            raise DataError("--response needs --formula, the declared model, such as --formula '1 + x'")
        direction, sides = (None, None) if options.direction is None else read_direction(options.direction)
        roles = Roles(
            options.response,
            options.formula,
            group=_names(options.group),
            whole_plot=_names([options.whole_plot] if options.whole_plot else None),
            replicate=options.replicate,
            time=options.time,
            direction=direction,
            sides=sides,
            candidates=None if options.candidates is None else _names(options.candidates),
            ignore=_names(options.ignore),
            wrap=options.wrap,
            date=options.date,
            date_order=options.date_order,
            own=own,
        )
        traced = trace_general_table(read, roles, validate=not options.quick)
        return with_failures(traced, source.table) if source.is_run else traced

    def calibration_of(self, given: Mapping[str, Any]) -> CurveCalibration | Mapping[str, CurveCalibration]:
        """For one response, or for every sensor of a run by its output."""
        from rig.procedures.general.infer import CurveCalibration  # noqa: PLC0415

        kept = given.get("budget", {}).get("calibration")
        if kept is not None:
            found = {str(name): CurveCalibration.from_dict(one) for name, one in kept.items()}
            return found if "sensors" in given else next(iter(found.values()))
        if "sensors" in given:
            return {name: CurveCalibration.from_dict(one["calibration"]) for name, one in given["sensors"].items()}
        if "calibration" not in given:
            raise FitError("it was written before tables of any kind could be inferred from; fit the table again")
        return CurveCalibration.from_dict(given["calibration"])

    def with_coefficients(
        self, calibration: CurveCalibration | Mapping[str, CurveCalibration], coefficients: Mapping[str, FloatArray]
    ) -> CurveCalibration | Mapping[str, CurveCalibration]:
        """A calibration from `calibration_of` with other coefficients (k,) by sensor, as `Evaluation.coefficients`
        gives them.
        """
        if isinstance(calibration, Mapping):
            return {name: one.moved(coefficients[name]) for name, one in calibration.items()}
        return calibration.moved(coefficients[calibration.response])

    def for_readings(
        self,
        calibration: CurveCalibration | Mapping[str, CurveCalibration],
        within: Mapping[str, Within],
        count: float,
    ) -> CurveCalibration | Mapping[str, CurveCalibration]:
        """A calibration from `calibration_of` for readings in use that are the mean of another number of them."""
        from rig.procedures.evaluate.readings import scatter_of  # noqa: PLC0415

        if isinstance(calibration, Mapping):
            return {n: one.for_readings(scatter_of(n, within, count), count) for n, one in calibration.items()}
        return calibration.for_readings(scatter_of(calibration.response, within, count), count)

    def infer(
        self,
        calibration: CurveCalibration | Mapping[str, CurveCalibration],
        read: Reader,
        options: InferOptions,
        other: Callable[[Path], Reader],
    ) -> Inference:
        """The abscissa of the curve."""
        from rig.procedures.general.infer_table import infer_general, infer_sensors  # noqa: PLC0415

        given = options.u_reading, options.quantity, options.between
        if isinstance(calibration, Mapping):
            return infer_sensors(calibration, read, *given)
        return infer_general(calibration, read, *given)

    def advice(self, procedure: GeneralProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """Confounded terms and effects, and errors without degrees of freedom."""
        super().advice(procedure, axes, usage_deg)
        from rig.procedures.general.planning import advice  # noqa: PLC0415

        return advice(procedure)

    def confirming(self, traced: GeneralTraced | RunTraced) -> Confirming | None:
        """A run that it traced, as the first of two; None if no further run is possible."""
        from rig.procedures.general.confirming import GeneralConfirming  # noqa: PLC0415
        from rig.procedures.general.of_runs import RunTraced  # noqa: PLC0415

        return GeneralConfirming(traced) if isinstance(traced, RunTraced) else None

    def declared_of(self, declared: Mapping[str, Any], sensor: str) -> Mapping[str, Any]:
        """Its own `[model.NAME]`, or that of all sensors."""
        own = declared.get(sensor)
        return own if isinstance(own, Mapping) else declared


_OF_RUNS = {"response", "formula"}
"""Options with which a run keeps its own whole plots, replications, time and direction."""
_NEEDS_RESPONSE = "{} needs --response, the column to be explained"


def _given(options: Options) -> list[str]:
    """Names of the options that were given."""
    return [name for name, value in options if value is not None and value is not False]


def _names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, each with one or several names separated by commas."""
    return tuple(name for text in given or () for part in text.split(",") if (name := part.strip()))


KIND = GeneralKind()
