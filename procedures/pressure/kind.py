"""The kind "whole-plot"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.fitter.errors import FitError
from rig.procedures.kind import Kind
from rig.procedures.pressure.options import BudgetOptions, FitOptions, InferOptions, TraceOptions
from rig.procedures.tables.unused import Unused, unused_in_fit

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.fitter.effects.own import Grammar
    from rig.procedures.evaluate.acceptance import Verdict
    from rig.procedures.evaluate.budgeting import Evaluation, Expected
    from rig.procedures.evaluate.charting import Charting
    from rig.procedures.evaluate.confirming import Confirming
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.evaluate.results import Fitted, Source, Traced
    from rig.procedures.plan.expected import Columns, Expecting
    from rig.procedures.plan.further_runs import Limits, Variation
    from rig.procedures.plan.precision import Precision
    from rig.procedures.plan.run_list import RunList
    from rig.procedures.pressure.evaluate import WholePlotTraced
    from rig.procedures.pressure.fit import PressureCalibration
    from rig.procedures.pressure.settings import WholePlotProcedure
    from rig.procedures.pressure.zeros import ZeroRows
    from rig.procedures.tables.table import Reader, Table


class PressureKind(Kind):
    """Pressure transducers in temperature whole plots. See `rig.procedures.kind.Kind`."""

    name = "whole-plot"
    title = "pressure transducers"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
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

    @property
    def settings(self) -> type[WholePlotProcedure]:
        """The model of procedure files, whose instances are a `Procedure`; None if the kind has no runs on a bench."""
        from rig.procedures.pressure.settings import WholePlotProcedure  # noqa: PLC0415

        return WholePlotProcedure

    @property
    def bench_factors(self) -> tuple[str, ...]:
        """Factors whose instrument a bench file may name."""
        from rig.procedures.pressure.settings import FACTORS  # noqa: PLC0415

        return FACTORS

    @cached_property
    def own_effects(self) -> Grammar:
        """Grammar of a laboratory's own effects; None if they are not possible."""
        from rig.procedures.pressure.effects.own import GRAMMAR  # noqa: PLC0415

        return GRAMMAR

    def explained(self, topic: str) -> str:
        """Markdown for `rig explain effects` (its catalogue) and `rig explain models`; "" for none."""
        from rig.procedures.pressure.effects.catalogue import catalogue  # noqa: PLC0415

        return catalogue() if topic == "effects" else ""

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

    def confirming(self, traced: WholePlotTraced) -> Confirming:
        """A run that it traced, as the first of two; None if no further run is possible."""
        from rig.procedures.pressure.confirming import WholePlotConfirming  # noqa: PLC0415

        return WholePlotConfirming(traced)

    def expected(self, procedure: WholePlotProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
        """A run as it is planned, for a forecast of total uncertainties."""
        from rig.procedures.pressure.planned import expected_run  # noqa: PLC0415

        return expected_run(procedure, run_list, sensors)

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

    @property
    def budget_options(self) -> type[BudgetOptions]:
        """Options of `rig budget` for this kind only."""
        return BudgetOptions

    def evaluation(
        self, table: Table, options: BudgetOptions, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """Coefficients, outputs and pressures by the declared model."""
        from rig.procedures.pressure.for_budgets import pressure_evaluation  # noqa: PLC0415

        return pressure_evaluation(table, options.formula, at, traced=options.traced)

    def charting(self) -> Charting:
        """Control charts of its sensors."""
        from rig.procedures.pressure.charting import CHARTING  # noqa: PLC0415

        return CHARTING

    def expecting(self, calibration: Mapping[str, PressureCalibration]) -> Expecting:
        """Expected readings of the sensors of a bench by a calibration from `calibration_of`."""
        from rig.procedures.pressure.expected import expected  # noqa: PLC0415

        return partial(expected, calibration)

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
        """Columns of the declared model of the outputs, for residuals of a running run."""
        from rig.procedures.pressure.expected import model_columns  # noqa: PLC0415

        return model_columns(columns)

    def unused(self, table: Table) -> Unused:
        """Columns of a table that fits and traces do not use."""
        from rig.procedures.pressure.table import KNOWN, UNIT  # noqa: PLC0415

        return unused_in_fit(table, KNOWN, UNIT)

    def check_design(self, procedure: WholePlotProcedure, run_list: RunList) -> None:
        """Check that the design can estimate the declared model, and that acceptance can be judged."""
        from rig.procedures.pressure.declared import check_declared  # noqa: PLC0415

        check_declared(procedure, run_list)

    def precision(self, procedure: WholePlotProcedure, run_list: RunList) -> Precision:
        """Precision of each term of the declared model."""
        from rig.procedures.pressure.planned import precision  # noqa: PLC0415

        try:
            return precision(procedure, run_list)
        except FitError as error:
            raise FitError(f"{error}; or plan a smaller model ([model] formula)") from error

    def judge(self, procedure: WholePlotProcedure, table: Table) -> Sequence[Verdict]:
        """Every sensor of a complete run compared with the procedure's limit; none without one."""
        from rig.procedures.pressure.acceptance import judge  # noqa: PLC0415

        return judge(procedure, table)

    def further_runs(self, procedure: WholePlotProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """Runs to follow a procedure, grouped by what they change, each group from the smallest to the largest."""
        from rig.procedures.pressure.further_runs import further_runs  # noqa: PLC0415

        return further_runs(procedure)


KIND = PressureKind()
