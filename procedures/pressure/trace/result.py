"""Findings of a trace of a whole-plot run, and the rows of its table before and after the effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, NOISE_GROWS, OUTLIERS
from rig.fitter.formula import Formula
from rig.fitter.json_values import JsonValue
from rig.fitter.split_plot import SplitPlotFit
from rig.fitter.trace.found import CONFIRMED, Explanation, Found, Unnamed
from rig.fitter.trace.growing_noise import Noise
from rig.fitter.trace.outcome import (
    CONDITIONAL,
    LEFT_OUT,
    OF_REPLICATIONS,
    Instead,
    Outcome,
    Parameter,
    Row,
    WithError,
    absent,
    run_json,
)
from rig.fitter.trace.signs import Refused
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureScene
from rig.procedures.pressure.trace.problem import Candidate, raw_columns


@dataclass(frozen=True, eq=False)
class FoundPressureEffect(Found):
    """An effect in one transducer.

    Attributes:
        formulas: its terms in the notation of `rig.fitter.formula`, for a declaration; empty if they have no such form.
        df: degrees of freedom of the coefficients' standard errors, those of the stratum.
        half_width_95: of the coefficients' 95 % intervals.
        contribution_mV: (n,) its contribution to the output of each reading; zero for a finding about noise.
        peak_mV: largest size of the part that the refitted declared model cannot absorb; for noise its largest sd.
        peak_psi: the same as pressure.
        constants: its time constant as JSON values, if it has one.
    """

    formulas: tuple[str, ...]
    df: tuple[float, ...]
    half_width_95: tuple[float, ...]
    contribution_mV: FloatArray
    peak_mV: float
    peak_psi: float
    constants: tuple[dict[str, JsonValue], ...] = ()

    @property
    def units(self) -> tuple[str, ...]:
        """Half-width of the 95 % interval of every coefficient."""
        given = tuple(self.unit.split(", "))
        return given if len(given) == len(self.terms) else (self.unit,) * len(self.terms)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its coefficients as rows after those of the declared model, where it is taken out."""
        if self.left_in:
            return ()
        rows = zip(self.terms, self.coefficients, self.stderr, self.df, self.units, strict=True)
        return tuple(
            Parameter(f"{self.effect}: {term}", WithError(value, error, df), unit=unit)
            for term, value, error, df, unit in rows
        )

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for pressure transducers only."""
        pairs = [(c, h if np.isfinite(h) else None) for c, h in zip(self.coefficients, self.half_width_95, strict=True)]
        return {
            "formulas": list(self.formulas),
            "df": [df if np.isfinite(df) else None for df in self.df],
            "lo95": [None if half is None else value - half for value, half in pairs],
            "hi95": [None if half is None else value + half for value, half in pairs],
            "rms_mV": float(np.sqrt(np.mean(self.contribution_mV**2))),
            "peak_mV": self.peak_mV,
            "peak_psi": self.peak_psi,
            **({"constants": [dict(one) for one in self.constants]} if self.constants else {}),
        }


@dataclass(frozen=True, eq=False)
class Side:
    """One transducer before or after the effects.

    Attributes:
        fit: of the declared model and the effects.
        declared: coefficients of the declared model consistent with those of the effects; see `Estimate`.
        reading_error_pct: by pressure in psia, largest residual, including whole-plot errors, over pressure.
        cv_rms: rms error of whole plots left out of selection and fit, mV, with their own error predicted as zero; None
            if they cannot be left out.
        residual_mV: (n,) including whole-plot errors, in the data's order of rows.
    """

    fit: SplitPlotFit
    declared: FloatArray
    reading_error_pct: Mapping[str, float | None]
    cv_rms: float | None
    residual_mV: FloatArray

    def rows(self) -> tuple[Row, ...]:
        """The same in the form of every kind of run, with the keys of pitch-roll runs as null."""
        return (
            *absent(OF_REPLICATIONS),
            Row(
                "sigma_subplot",
                self.fit.sigma_subplot,
                "mV",
                label="within whole plots / mV",
                meaning="standard deviation of one reading at constant temperature",
            ),
            Row(
                "sigma_wholeplot",
                self.fit.sigma_wholeplot,
                "mV",
                label="between whole plots / mV",
                meaning="of the error that is new at every change of temperature",
            ),
            Row("sigma_replicate", self.fit.sigma_replicate, "mV"),
            Row(
                "reading_error_pct",
                dict(self.reading_error_pct),
                "%",
                label="reading error at {} psia / %",
            ),
            Row(
                "cv_rms",
                self.cv_rms,
                "mV",
                label="left-out error / mV",
                meaning="rms error at whole plots that were left out of the fit, including their own error",
            ),
        )


@dataclass(frozen=True, eq=False)
class TransducerTrace:
    """Findings in one transducer.

    Attributes:
        sensor: column name of its output.
        declared: the declared model.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained".
        before: with the declared model.
        after: with the effects removed.
        effects: found, largest share first, findings about the noise last.
        unnamed: the remainder, if it exceeds error.
        alike: sentences about effects that are equal in all transducers.
        noise: dependence of the scatter within whole plots on pressure.
        sensitivity: mV/psi.
        refused: causes that would fit, except for their required sign.
        keeping: sentences about effects that were not kept, or kept because of other sensors.
        instead: one shape without a name in place of the doubtful effects.
    """

    sensor: str
    declared: str
    verdict: str
    before: Side
    after: Side
    effects: tuple[FoundPressureEffect, ...]
    unnamed: tuple[Unnamed, ...]
    alike: tuple[str, ...]
    noise: Noise
    sensitivity: float
    refused: tuple[Refused, ...] = ()
    keeping: tuple[str, ...] = ()
    instead: Instead | None = None

    def outcome(self) -> Outcome:
        """The same in the form of every kind of run."""
        return Outcome(
            sensor=self.sensor,
            declared=self.declared,
            verdict=self.verdict,
            findings=(*(one.finding() for one in self.effects), *(rest.finding() for rest in self.unnamed)),
            before=self.before.rows(),
            after=self.after.rows(),
            fitted=self._fitted(),
            notes=self.notes,
            instead=self.instead,
            refused=tuple(one.to_json() for one in self.refused),
        )

    @property
    def added(self) -> tuple[FoundPressureEffect, ...]:
        """Effects that add to the model."""
        return tuple(effect for effect in self.effects if effect.stratum != "noise")

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences shown with the numbers before and after."""
        notes = [*self.after.fit.notes, *self.alike, *self.keeping, *(one.sentence for one in self.refused)]
        means = self.added
        named = {effect.effect for effect in self.effects}
        if NOISE_GROWS in named:
            where, wide, narrow = ("with pressure", "at low pressure", "at high")
            if self.noise.middle is not None:
                where, wide, narrow = ("towards both ends of the pressures", "in the middle", "at the ends")
            notes.append(
                f"noise grows {where}: intervals that take one sd for all pressures are too wide {wide} and too narrow "
                f"{narrow}; readings were weighted by it here"
            )
        if AUTOCORRELATION in named:
            notes.append(
                "successive readings' errors are alike: intervals that take them for independent are too narrow for "
                "what changes slowly within whole plots; effects were judged beside that here"
            )
        if OUTLIERS in named:
            notes.append("readings that stand out are left out of everything here, before and after; they are listed")
        if any(effect.stratum == "whole-plot" for effect in means):
            count = len(self.after.fit.whole_plots)
            notes.append(f"effects between whole plots were judged on {count} numbers, one a whole plot")
        if means:
            notes.append(CONDITIONAL)
        before, after = self.before.cv_rms, self.after.cv_rms
        if before is not None and after is not None:
            if any(effect.stratum == "whole-plot" for effect in means) and after > CONFIRMED * before:
                notes.append(
                    "not confirmed by left-out whole plots: with the effects found the error on those left out is "
                    f"{after / before:.0%} of what it is without them"
                )
            elif means and after >= before:
                notes.append(
                    "the error on left-out whole plots does not fall with the effects found "
                    f"({before:.3g} to {after:.3g} mV): the data left out do not confirm them"
                )
            notes.append(
                f"{LEFT_OUT}each whole plot in turn left out of selection and fit, its error predicted as zero"
            )
        return tuple(notes)

    def _fitted(self) -> tuple[Parameter, ...]:
        fit = self.after.fit
        adjusted = fit.kenward_roger()
        declared = zip(fit.names, self.after.declared, adjusted.stderr, fit.df, strict=False)  # effects come after them
        own = (Parameter(name, WithError(float(v), float(e), float(df))) for name, v, e, df in declared)
        return (*own, *(one for effect in self.added for one in effect.parameters))


@dataclass(frozen=True, eq=False)
class WholePlotTrace:
    """Findings in a run.

    Attributes:
        sensors: by column name.
        formula: of the declared model.
        scene: references of the effects' columns.
        chosen: the terms in the model.
        gamma: (q,) their coefficients, in the terms' own units.
        points: number of readings.
        taken: (S, q) one where a term is taken out of a transducer's output, zero where it is left in.
        explanations: all of them for each effect found, best first.
    """

    sensors: Mapping[str, TransducerTrace]
    formula: Formula
    scene: PressureScene
    chosen: tuple[Candidate, ...]
    gamma: FloatArray
    points: int
    taken: FloatArray
    explanations: Mapping[str, tuple[Explanation, ...]] = field(default_factory=dict)

    @property
    def about(self) -> dict[str, JsonValue]:
        """Properties of the run as JSON values."""
        return {"points": self.points, "kind": "whole-plot"}

    @property
    def reference(self) -> dict[str, JsonValue]:
        """References at which the effects' columns are zero, as JSON values."""
        return {
            "sensor_temperature_degC": self.scene.sensor_degC,
            "sse_temperature_degC": self.scene.sse_degC,
            "elapsed_s": self.scene.elapsed_s,
        }

    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each transducer, in the form of every kind of run."""
        return tuple(found.outcome() for found in self.sensors.values())

    def predict(self, data: WholePlotData) -> dict[str, FloatArray]:
        """(n,) outputs of each transducer for other readings, with effects, and with whole-plot errors zero, mV."""
        _, columns = self.formula.columns(data.table, self.formula.levels(self.scene.data.table))
        scene = replace(self.scene, data=data)
        raw = raw_columns(scene, tuple(self.sensors), self.chosen)
        extra = np.einsum("snq,sq->sn", raw, self.taken * self.gamma)
        return {s: columns @ t.after.declared + extra[i] for i, (s, t) in enumerate(self.sensors.items())}

    def to_json(self, file: str | None = None) -> dict[str, JsonValue]:
        """JSON values for `rig trace --json`; missing numbers are None, never NaN."""
        return run_json({"file": file, **self.about}, self.outcomes(), reference=self.reference)
