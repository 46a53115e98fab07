"""The kind "whole-plot"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.procedures.kind import Kind, lazily
from rig.procedures.pressure.options import BudgetOptions, FitOptions, InferOptions, TraceOptions

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.procedures.evaluate.budgeting import Evaluation
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.evaluate.results import Fitted, Source, Traced
    from rig.procedures.plan.expected import Columns
    from rig.procedures.pressure.fit import PressureCalibration
    from rig.procedures.pressure.zeros import ZeroRows
    from rig.procedures.tables.table import Reader, Table


class PressureKind(Kind):
    """Pressure transducers in temperature whole plots. See `rig.procedures.kind.Kind`."""

    name = "whole-plot"
    title = "pressure transducers"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    budget_options = BudgetOptions
    settings = lazily("settings:WholePlotProcedure")
    bench_factors = lazily("settings:FACTORS")
    own_effects = lazily("effects.own:GRAMMAR")
    explained = lazily("effects.catalogue:explained")
    expected = lazily("planned:expected_run")
    expecting = lazily("expected:expecting")
    model_columns = lazily("expected:model_columns")
    unused = lazily("table:unused")
    check_design = lazily("declared:check_declared")
    precision = lazily("planned:precision")
    judge = lazily("fitted:judge")
    charting = lazily("charting:PressureCharting")
    confirming = lazily("confirming:WholePlotConfirming")
    further_runs = lazily("further_runs:further_runs")
    described = (
        "a whole-plot table has whole_plot,order,elapsed_s,pressure_psia,sensor_temperature_degC,"
        "sse_temperature_degC and NAME_mV"
    )
    in_use = (
        "the output, sensor_temperature_degC and sse_temperature_degC. Reading the zero in vacuum first (in flight, "
        "before entry) takes out the error that a change of temperature draws again; its own error is in the "
        "interval: `rig infer calibration.json flight.csv --zero vacuum.csv --out pressures.csv`, or a column "
        "`vacuum`, 1 for rows read at zero pressure. Intervals hold as long as the temperatures have stood since "
        "the zero was read: rows at other temperatures are flagged. Values outside the calibrated range are "
        "flagged, not extrapolated. The zero is compared with the calibration: one that is hard to believe is "
        "flagged in every row. Several zero rows are of one sitting or independent: --zero-rows says which"
    )

    def recognises(self, columns: Collection[str]) -> bool:
        """By columns of this kind only."""
        return bool({"whole_plot", "pressure_psia"} & set(columns))

    def fit(
        self, source: Source, options: FitOptions, *, leave_out: Sequence[str], own: Laboratory, keep: bool
    ) -> Fitted:
        """Every transducer by every method."""
        from rig.procedures.pressure.fitted import fit_whole_plots  # noqa: PLC0415

        given = options.model_dump(exclude_none=True, exclude={"formula"})
        return fit_whole_plots(source.table, options.formula, leave_out=leave_out, **given)

    def trace(self, source: Source, options: TraceOptions, *, own: Laboratory) -> Traced:
        """Find effects missing in the declared model; arguments and errors as for `fit`."""
        from rig.procedures.pressure.evaluate import trace_whole_plot_table  # noqa: PLC0415

        return trace_whole_plot_table(source.table, options.formula, own, validate=not options.quick)

    def calibration_of(self, given: Mapping[str, Any]) -> Mapping[str, PressureCalibration]:
        """The calibration from the JSON of `rig fit --out`."""
        from rig.procedures.pressure.fit import PressureCalibration  # noqa: PLC0415

        return {n: PressureCalibration.from_dict(one["calibration"]) for n, one in given["sensors"].items()}

    def notes_of(self, given: Mapping[str, Any]) -> tuple[str, ...]:
        """Result of a follow-up run for each effect, and its use in the calibration."""
        return tuple(str(effect["used"]) for effect in given.get("confirmed_by", {"effects": ()})["effects"])

    def infer(
        self,
        calibration: Mapping[str, PressureCalibration],
        read: Reader,
        options: InferOptions,
        other: Callable[[Path], Reader],
    ) -> Inference:
        """Pressure."""
        from rig.procedures.pressure.infer_table import infer_pressures  # noqa: PLC0415

        zero = None if options.zero is None else other(options.zero)
        meaning: ZeroRows | None = None if options.zero_rows is None else options.zero_rows.value
        return infer_pressures(calibration, read, zero, meaning)

    def with_coefficients(
        self, calibration: Mapping[str, PressureCalibration], coefficients: Mapping[str, FloatArray]
    ) -> Mapping[str, PressureCalibration]:
        """A calibration from `calibration_of` with other coefficients (k,) by sensor, as `Evaluation.coefficients`
        gives them.
        """
        return {
            name: replace(one, coefficients=coefficients[name]) if name in coefficients else one
            for name, one in calibration.items()
        }

    def placed(self, columns: Columns, constants: Mapping[str, float]) -> Columns:
        """With the pressure at the transducers, by their height above the standard's reference level."""
        from rig.procedures.pressure.influences import line_head  # noqa: PLC0415

        height = constants.get("line_head", 0.0)
        return {**columns, "pressure_psia": line_head(columns["pressure_psia"], height)} if height else columns

    def evaluation(
        self, table: Table, options: BudgetOptions, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """Coefficients, outputs and pressures by the declared model."""
        from rig.procedures.pressure.for_budgets import pressure_evaluation  # noqa: PLC0415

        return pressure_evaluation(table, options.formula, at, traced=options.traced)


KIND = PressureKind()
