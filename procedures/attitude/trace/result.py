"""Findings of a trace, and the rows of its table before and after the effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import JsonValue
from rig.fitter.replication import Replication
from rig.fitter.sums_of_squares import FTest
from rig.fitter.trace.found import CONFIRMED, Explanation, Found, Unnamed
from rig.fitter.trace.outcome import CONDITIONAL, LEFT_OUT, Instead, Outcome, Parameter, Row, WithError, run_json
from rig.fitter.trace.signs import Refused
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.fit import coefficient_table, table_2, temperature_table
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.temperature import Temperature
from rig.procedures.attitude.trace.alternatives import Alternative
from rig.procedures.attitude.trace.estimate import predict
from rig.procedures.attitude.trace.problem import Candidate, raw_columns
from rig.procedures.present.words import TESTS


@dataclass(frozen=True, eq=False)
class FoundEffect(Found):
    """An effect in one attitude sensor.

    Attributes:
        columns_V: (n, q) contribution of each of its terms to the output of each observation.
        df: degrees of freedom of its standard errors.
    """

    columns_V: FloatArray
    df: float

    @property
    def contribution_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(n,) its contribution to the output of each observation."""
        return np.asarray(self.columns_V.sum(axis=1))

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for attitude sensors only."""
        return {"rms_V": float(np.sqrt(np.mean(self.contribution_V**2)))}


@dataclass(frozen=True, eq=False)
class SensorTrace:
    """Findings in one sensor.

    Attributes:
        sensor: column name of its output.
        declared: the declared model.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained".
        before: Table 2 with the declared model.
        after: Table 2 with the effects removed.
        cv_rms_before: rms error of left-out replications, V; None for a single replication.
        cv_rms_after: the same after, with a search without the left-out replication.
        effects: found, largest share first.
        unnamed: the remainder, if it exceeds error.
        shared_attitude_before: agreement of commands with the same attitude; only the head can cause differences, not
            gravity.
        shared_attitude_after: the same with the effects removed.
        fit: the declared model, fitted with the effects.
        temperature: its temperature terms; None without.
        S_V: sensitivity, for conversion of volts to degrees.
        residual_before_V: (n,) residual of the declared model, in the data's order of rows.
        residual_after_V: (n,) residual with the effects.
        temperature_recorded: whether effects of temperature could be tested.
        noise: findings about noise; in JSON these are effects of stratum "noise".
        smooth: terms without a cause that were added.
        refused: causes that would fit, except for their required sign.
        keeping: sentences about effects that were not kept, or kept because of other sensors.
        instead: one shape without a name in place of the doubtful effects.
    """

    sensor: str
    declared: str
    verdict: str
    before: Replication
    after: Replication
    cv_rms_before: float | None
    cv_rms_after: float | None
    effects: tuple[FoundEffect, ...]
    unnamed: tuple[Unnamed, ...]
    shared_attitude_before: FTest
    shared_attitude_after: FTest
    fit: LinearFit
    temperature: Temperature | None
    S_V: float
    residual_before_V: FloatArray
    residual_after_V: FloatArray
    temperature_recorded: bool
    noise: tuple[Found, ...] = ()
    smooth: tuple[FoundEffect, ...] = ()
    refused: tuple[Refused, ...] = ()
    keeping: tuple[str, ...] = ()
    instead: Instead | None = None

    def outcome(self) -> Outcome:
        """The same in the form of every kind of run."""
        return Outcome(
            sensor=self.sensor,
            declared=self.declared,
            verdict=self.verdict,
            findings=(
                *(effect.finding() for effect in (*self.effects, *self.noise)),
                *(rest.finding() for rest in self.unnamed),
            ),
            before=self._side(self.before, self.cv_rms_before, self.shared_attitude_before),
            after=self._side(self.after, self.cv_rms_after, self.shared_attitude_after),
            fitted=self._fitted(),
            notes=self.notes,
            instead=self.instead,
            refused=tuple(one.to_json() for one in self.refused),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences shown with the numbers before and after."""
        notes = [*(one.sentence for one in self.refused), *self.keeping]
        if self.after.blind is not None:
            notes.append(self.after.blind.sentence)
        if not self.temperature_recorded:
            notes.append("no sensor temperature was recorded: temperature effects could not be tested")
        if self.effects and self.after.drift_b.value > self.before.drift_b.value:
            notes.append(
                "T_b rose because the lack of fit that was removed stood in its denominator; p_drift is free of that"
            )
        if self.effects:
            notes.append(CONDITIONAL)
        if self.smooth:
            notes.append("smooth terms without a cause are in the fit: they describe these points and explain nothing")
        if self.cv_rms_before is not None and self.cv_rms_after is not None:
            if (self.effects or self.smooth) and self.cv_rms_after > CONFIRMED * self.cv_rms_before:
                notes.append(
                    "not confirmed by left-out replications: with the effects found the error on those left out "
                    f"is {self.cv_rms_after / self.cv_rms_before:.0%} of what it is without them"
                )
            notes.append(
                f"{LEFT_OUT}each replication in turn left out of selection and fit, its offset predicted as zero"
            )
        return tuple(notes)

    def _side(self, table: Replication, cv_rms: float | None, shared: FTest) -> tuple[Row, ...]:
        known = np.isfinite(shared.value)
        values = {
            **table_2(table, self.S_V),
            "cv_rms": cv_rms,
            "cv_rms_deg": None if cv_rms is None else float(np.degrees(cv_rms / self.S_V)),
            "T_shared_attitude": shared.value if known else None,
            "F_shared_attitude_95": shared.limit_95 if known else None,
        }
        return tuple(_row(name, value, values) for name, value in values.items())

    def _fitted(self) -> tuple[Parameter, ...]:
        table = coefficient_table(self.fit) | temperature_table(self.temperature, self.S_V, self.fit.df)
        own = (Parameter(name, WithError.of_json(row)) for name, row in table.items())
        return (*own, *(one for effect in (*self.effects, *self.smooth) for one in effect.parameters))


_SHOWN = {
    "sigma_E_deg": ("sigma_E / 1e-4 deg", "standard error of one observation"),
    "sigma_bias_deg": ("sigma_bias / 1e-4 deg", "its part from lack of fit"),
    "sigma_prec_deg": ("sigma_prec / 1e-4 deg", "its part from scatter between replications"),
    "T_bias": ("T_bias", "lack of fit against scatter"),
    "F_bias_95": ("its 95 % limit", ""),
    "T_b": ("T_b", "offset between replications"),
    "T_S": ("T_S", "sensitivity between replications"),
    "F_bS_95": ("their 95 % limit", ""),
    "cv_rms_deg": ("left-out error / 1e-4 deg", "rms error at replications that were left out of the fit"),
}
"""Label and meaning of the values for people."""


def _row(name: str, value: JsonValue, values: Mapping[str, JsonValue]) -> Row:
    label, meaning = _SHOWN.get(name, ("", ""))
    limit = values[TESTS[name]] if name in TESTS else None
    return Row(
        name,
        value,
        _unit(name),
        limit=limit if isinstance(limit, float) else None,
        meaning=meaning,
        label=label,
        scale=1e4 if name.endswith("_deg") else 1.0,
        in_reports=name in TESTS.values(),
    )


def _unit(name: str) -> str:
    """Unit of a row by its name; sigmas and left-out errors are in volts, or in degrees by their name."""
    if name.endswith("_deg"):
        return "deg"
    return "V" if name.startswith(("sigma_", "cv_rms")) else ""


@dataclass(frozen=True, eq=False)
class Trace:
    """Findings in a run.

    Attributes:
        sensors: by column name.
        scene: references of the effects' columns.
        chosen: the terms in the model.
        gamma: (q,) their coefficients, in the terms' own units.
        taken: (S, q) one where a term is taken out of a sensor's output, zero where it is left in.
        points: number of observations.
        outliers: outliers, left out of search and fit.
        explanations: all of them for each effect found, best first.
        alternatives: the effects with another member of a class in place of the named one, one for every member.
    """

    sensors: Mapping[str, SensorTrace]
    scene: Scene
    chosen: tuple[Candidate, ...]
    gamma: FloatArray
    taken: FloatArray
    points: int
    outliers: tuple[int, ...] = ()
    explanations: Mapping[str, tuple[Explanation, ...]] = field(default_factory=dict)
    alternatives: tuple[Alternative, ...] = ()

    @property
    def about(self) -> dict[str, JsonValue]:
        """Properties of the run as JSON values."""
        return {"points": self.points, "kind": "pitch-roll"}

    @property
    def reference(self) -> dict[str, JsonValue]:
        """References at which the effects' columns are zero, as JSON values."""
        return {"temperature_degC": self.scene.temperature_degC, "elapsed_s": self.scene.elapsed_s}

    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each sensor, in the form of every kind of run."""
        return tuple(found.outcome() for found in self.sensors.values())

    def predict(self, data: AttitudeData) -> dict[str, FloatArray]:
        """(n,) outputs of each sensor for other observations, with effects, volts."""
        extra = np.einsum("snq,sq->sn", raw_columns(self.scene.on(data), self.chosen), self.taken * self.gamma)
        h = attitude_columns(data.pitch_deg, data.roll_deg, roll=self.scene.roll)
        return {s: predict(h, data, t.fit, t.temperature) + extra[i] for i, (s, t) in enumerate(self.sensors.items())}

    def to_json(self, file: str | None = None) -> dict[str, JsonValue]:
        """JSON values for `rig trace --json`; missing numbers are None, never NaN."""
        return run_json({"file": file, **self.about}, self.outcomes(), reference=self.reference)
