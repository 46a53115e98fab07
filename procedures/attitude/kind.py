"""The kind "pitch-roll"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.procedures.attitude.options import BudgetOptions, FitOptions, InferOptions, TraceOptions
from rig.procedures.errors import DataError
from rig.procedures.kind import Kind
from rig.procedures.tables.unused import Unused, unused_in_fit

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.fitter.effects.own import Grammar
    from rig.procedures.attitude.evaluate import AttitudeTraced
    from rig.procedures.attitude.infer import AttitudeCalibration
    from rig.procedures.attitude.settings import PitchRollProcedure
    from rig.procedures.evaluate.acceptance import Verdict
    from rig.procedures.evaluate.budgeting import Evaluation, Expected
    from rig.procedures.evaluate.charting import Charting
    from rig.procedures.evaluate.confirming import Confirming
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.evaluate.results import Compared, Fitted, Source, Traced
    from rig.procedures.plan.advice import Advice
    from rig.procedures.plan.expected import Columns, Expecting
    from rig.procedures.plan.further_runs import Limits, Variation
    from rig.procedures.plan.precision import Precision
    from rig.procedures.plan.run_list import RunList
    from rig.procedures.tables.table import Reader, Table
    from rig.procedures.tables.within import Within


class AttitudeKind(Kind):
    """Inertial attitude sensors on a dividing head. See `rig.procedures.kind.Kind`."""

    name = "pitch-roll"
    title = "attitude sensors"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    described = "a pitch-roll table has replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC and NAME_V"
    in_use = (
        "the columns of the calibrated sensors (x_V, y_V, z_V), and the sensor temperature where the calibration "
        "has it in. A single sensor needs roll that was measured otherwise: `rig infer package.json x-only.csv "
        "--sensors x_V --roll roll_deg --roll-sd 0.05 --out pitch.csv`. Where an angle is undetermined it is left "
        "open, with the reason in `flag`. Some packages have two attitudes for the same outputs; rows where --near "
        "decided are marked in a column `assumed`: `rig infer package.json upside-down.csv --near 0 180 --out "
        "angles.csv`"
    )

    @property
    def settings(self) -> type[PitchRollProcedure]:
        """The model of procedure files, whose instances are a `Procedure`; None if the kind has no runs on a bench."""
        from rig.procedures.attitude.settings import PitchRollProcedure  # noqa: PLC0415

        return PitchRollProcedure

    @cached_property
    def own_effects(self) -> Grammar:
        """Grammar of a laboratory's own effects; None if they are not possible."""
        from rig.procedures.attitude.effects.own import GRAMMAR  # noqa: PLC0415

        return GRAMMAR

    def explained(self, topic: str) -> str:
        """Markdown for `rig explain effects` (its catalogue) and `rig explain models`; "" for none."""
        from rig.procedures.attitude.effects.catalogue import catalogue  # noqa: PLC0415

        return catalogue() if topic == "effects" else ""

    def recognises(self, columns: Collection[str]) -> bool:
        """By columns of this kind only."""
        return bool({"pitch_deg", "roll_deg"} & set(columns))

    def fit(
        self, source: Source, options: FitOptions, *, leave_out: Sequence[str], own: Laboratory, keep: bool
    ) -> Fitted:
        """Every sensor, or with `points` fractions of the run in addition to the whole."""
        if options.points is not None:
            return self._fractions(source, options, leave_out, keep=keep)
        from rig.procedures.attitude.fitted import AttitudeFitted, fit_attitude_table  # noqa: PLC0415

        result = fit_attitude_table(
            source.table,
            traced=options.traced,
            temperature=options.temperature,
            at_degC=options.at_degC,
            leave_out=leave_out,
            own=own,
        )
        return AttitudeFitted(result, source.table)

    def _fractions(self, source: Source, options: FitOptions, leave_out: Sequence[str], *, keep: bool) -> Fitted:
        from rig.procedures.attitude.fractions_compared import FractionsCompared, compare_fractions  # noqa: PLC0415

        assert options.points is not None
        given = {"--traced": options.traced, "--at-degC": options.at_degC is not None}
        for option, value in {**given, "--leave-out": leave_out, "--out": keep}.items():
            if value:
                raise DataError(
                    f"--points holds fractions against the whole run and keeps nothing; leave {option} away"
                )
        result = compare_fractions(source.table, options.points, temperature=options.temperature)
        return FractionsCompared(result, source.table, options.points)

    def trace(self, source: Source, options: TraceOptions, *, own: Laboratory) -> Traced:
        """Find effects missing in the declared model; arguments and errors as for `fit`."""
        from rig.procedures.attitude.evaluate import trace_attitude_table  # noqa: PLC0415

        return trace_attitude_table(source.table, temperature=options.temperature, unnamed=options.unnamed, own=own)

    def calibration_of(self, given: Mapping[str, Any]) -> AttitudeCalibration:
        """The calibration from the JSON of `rig fit --out`. Raises the errors of indexing and converting unknown
        values.
        """
        from rig.procedures.attitude.infer import AttitudeCalibration  # noqa: PLC0415

        return AttitudeCalibration.from_dict(given.get("budget", {}).get("calibration") or given["calibration"])

    def expected(self, procedure: PitchRollProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
        """A run as it is planned, for a forecast of total uncertainties."""
        from rig.procedures.attitude.planned import expected_run  # noqa: PLC0415

        return expected_run(procedure, run_list, sensors)

    def with_coefficients(
        self, calibration: AttitudeCalibration, coefficients: Mapping[str, FloatArray]
    ) -> AttitudeCalibration:
        """A calibration from `calibration_of` with other coefficients (k,) by sensor, as `Evaluation.coefficients`
        gives them, of the declared model.
        """
        from rig.procedures.attitude.results import with_coefficients  # noqa: PLC0415

        return with_coefficients(calibration, np.array([coefficients[name] for name in calibration.names]))

    def for_readings(
        self, calibration: AttitudeCalibration, within: Mapping[str, Within], count: float
    ) -> AttitudeCalibration:
        """A calibration from `calibration_of` for readings in use that are the mean of another number of them."""
        from rig.procedures.evaluate.readings import scatter_of  # noqa: PLC0415

        return calibration.for_readings({n: scatter_of(n, within, count) for n in calibration.names}, count)

    def infer(
        self, calibration: AttitudeCalibration, read: Reader, options: InferOptions, other: Callable[[Path], Reader]
    ) -> Inference:
        """Pitch and roll."""
        from rig.procedures.attitude.infer_table import infer_attitudes  # noqa: PLC0415

        sensors = options.sensors
        return infer_attitudes(
            calibration,
            read,
            measured_roll=options.roll,
            roll_sd_deg=options.roll_sd,
            near_deg=options.near,
            sensors=None if sensors is None else [name.strip() for name in sensors.split(",")],
        )

    def confirming(self, traced: AttitudeTraced) -> Confirming:
        """A run that it traced, as the first of two; None if no further run is possible."""
        from rig.procedures.attitude.confirming import AttitudeConfirming  # noqa: PLC0415

        return AttitudeConfirming(traced)

    @property
    def budget_options(self) -> type[BudgetOptions]:
        """Options of `rig budget` for this kind only."""
        return BudgetOptions

    def evaluation(
        self, table: Table, options: BudgetOptions, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """Parameters, outputs and angles by the declared model."""
        from rig.procedures.attitude.for_budgets import attitude_evaluation  # noqa: PLC0415

        return attitude_evaluation(
            table, at, temperature=options.temperature, traced=options.traced, gravity=constants.get("gravity")
        )

    def charting(self) -> Charting:
        """Control charts of its sensors. Raises `DataError` if there are none."""
        from rig.procedures.attitude.charting import CHARTING  # noqa: PLC0415

        return CHARTING

    def expecting(self, calibration: AttitudeCalibration) -> Expecting:
        """Expected readings of the sensors of a bench by a calibration from `calibration_of`."""
        from rig.procedures.attitude.expected import expected  # noqa: PLC0415

        return partial(expected, calibration)

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
        """Columns of the declared model of the outputs, for residuals of a running run."""
        from rig.procedures.attitude.expected import model_columns  # noqa: PLC0415

        return model_columns(columns, temperature=bool(declared.get("temperature")))

    def unused(self, table: Table) -> Unused:
        """Columns of a table that fits and traces do not use."""
        from rig.procedures.attitude.table import KNOWN, UNIT  # noqa: PLC0415

        return unused_in_fit(table, KNOWN, UNIT)

    def precision(self, procedure: PitchRollProcedure, run_list: RunList) -> Precision:
        """Precision of a sensor's calibrated output at a few pitch angles."""
        from rig.procedures.attitude.planned import precision  # noqa: PLC0415

        return precision(procedure, run_list)

    def advice(self, procedure: PitchRollProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """Recommendations of NASA/TP-1999-209835."""
        from rig.procedures.attitude.advice import advise, package_of, usage_of  # noqa: PLC0415

        found = advise(procedure, usage_of(procedure, usage_deg), package_of(procedure, axes))
        return [one for one in found if one.applies]

    def compare(
        self,
        procedures: Sequence[PitchRollProcedure],
        names: Sequence[str],
        axes: Collection[str],
        usage: float | None,
        hours: Sequence[float],
    ) -> Compared:
        """By the figures of merit of NASA/TP-1999-209835."""
        from rig.procedures.attitude.compared import compare_designs  # noqa: PLC0415

        return compare_designs(procedures, names, axes, usage, hours)

    def judge(self, procedure: PitchRollProcedure, table: Table) -> Sequence[Verdict]:
        """Every sensor of a complete run compared with the procedure's limit; none without one. Raises `DataError`."""
        from rig.procedures.attitude.fitted import judge  # noqa: PLC0415

        return judge(procedure, table)

    def further_runs(self, procedure: PitchRollProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """Runs to follow a procedure, grouped by what they change, each group from the smallest to the largest."""
        from rig.procedures.attitude.further_runs import further_runs  # noqa: PLC0415

        return further_runs(procedure, limits, chamber=chamber)


KIND = AttitudeKind()
