"""The kind "pitch-roll"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.procedures.attitude.options import BudgetOptions, FitOptions, InferOptions, TraceOptions
from rig.procedures.errors import DataError
from rig.procedures.kind import Kind, lazily

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.procedures.attitude.infer import AttitudeCalibration
    from rig.procedures.evaluate.budgeting import Evaluation
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.evaluate.results import Fitted, Source, Traced
    from rig.procedures.tables.table import Reader, Table
    from rig.procedures.tables.within import Within


class AttitudeKind(Kind):
    """Inertial attitude sensors on a dividing head. See `rig.procedures.kind.Kind`."""

    name = "pitch-roll"
    title = "attitude sensors"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    budget_options = BudgetOptions
    settings = lazily("settings:PitchRollProcedure")
    own_effects = lazily("effects.own:GRAMMAR")
    explained = lazily("effects.catalogue:explained")
    expected = lazily("planned:expected_run")
    expecting = lazily("expected:expecting")
    model_columns = lazily("expected:model_columns")
    unused = lazily("table:unused")
    precision = lazily("planned:precision")
    advice = lazily("advice:advice")
    compare = lazily("compared:compare_designs")
    judge = lazily("fitted:judge")
    charting = lazily("charting:AttitudeCharting")
    confirming = lazily("confirming:AttitudeConfirming")
    further_runs = lazily("further_runs:further_runs")
    described = "a pitch-roll table has replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC and NAME_V"
    in_use = (
        "the columns of the calibrated sensors (x_V, y_V, z_V), and the sensor temperature where the calibration "
        "has it in. A single sensor needs roll that was measured otherwise: `rig infer package.json x-only.csv "
        "--sensors x_V --roll roll_deg --roll-sd 0.05 --out pitch.csv`. Where an angle is undetermined it is left "
        "open, with the reason in `flag`. Some packages have two attitudes for the same outputs; rows where --near "
        "decided are marked in a column `assumed`: `rig infer package.json upside-down.csv --near 0 180 --out "
        "angles.csv`"
    )

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

        temperature, unnamed, validate = options.temperature, options.unnamed, not options.quick
        return trace_attitude_table(source.table, temperature=temperature, unnamed=unnamed, own=own, validate=validate)

    def calibration_of(self, given: Mapping[str, Any]) -> AttitudeCalibration:
        """The calibration from the JSON of `rig fit --out`. Raises the errors of indexing and converting unknown
        values.
        """
        from rig.procedures.attitude.infer import AttitudeCalibration  # noqa: PLC0415

        return AttitudeCalibration.from_dict(given.get("budget", {}).get("calibration") or given["calibration"])

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

    def evaluation(
        self, table: Table, options: BudgetOptions, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """Parameters, outputs and angles by the declared model."""
        from rig.procedures.attitude.for_budgets import attitude_evaluation  # noqa: PLC0415

        return attitude_evaluation(
            table, at, temperature=options.temperature, traced=options.traced, gravity=constants.get("gravity")
        )


KIND = AttitudeKind()
