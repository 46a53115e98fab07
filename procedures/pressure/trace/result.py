"""Findings of a trace of a whole-plot run, and the rows of its table before and after the effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.formula import Formula
from rig.fitter.json_values import JsonValue
from rig.fitter.split_plot import SplitPlotFit
from rig.fitter.trace.found import TracedRun, TracedSensor
from rig.fitter.trace.growing_noise import Noise
from rig.fitter.trace.outcome import OF_REPLICATIONS, Finding, Parameter, Row, WithError, absent
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.trace.problem import Candidate, raw_columns


@dataclass(frozen=True, eq=False)
class FoundPressureEffect(Finding):
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

    formulas: tuple[str, ...] = field(default=(), kw_only=True)
    df: tuple[float, ...] = field(kw_only=True)
    half_width_95: tuple[float, ...] = field(kw_only=True)
    contribution_mV: FloatArray = field(kw_only=True)
    peak_mV: float = field(kw_only=True)
    peak_psi: float = field(kw_only=True)
    constants: tuple[dict[str, JsonValue], ...] = field(default=(), kw_only=True)

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
class TransducerTrace(TracedSensor[Side, FoundPressureEffect]):
    """Findings in one transducer.

    Attributes:
        noise_within: dependence of the scatter within whole plots on pressure.
        sensitivity: mV/psi.
    """

    noise_within: Noise
    sensitivity: float


@dataclass(frozen=True, eq=False)
class WholePlotTrace(TracedRun[TransducerTrace, Candidate]):
    """Findings in a run.

    Attributes:
        formula: of the declared model.
    """

    formula: Formula
    kind = "whole-plot"

    @property
    def reference(self) -> dict[str, JsonValue]:
        """See `TracedRun`."""
        return {
            "sensor_temperature_degC": self.scene.sensor_degC,
            "sse_temperature_degC": self.scene.sse_degC,
            "elapsed_s": self.scene.elapsed_s,
        }

    def predict(self, data: WholePlotData) -> dict[str, FloatArray]:
        """(n,) outputs of each transducer for other readings, with effects, and with whole-plot errors zero, mV."""
        _, columns = self.formula.columns(data.table, self.formula.levels(self.scene.data.table))
        scene = replace(self.scene, data=data)
        raw = raw_columns(scene, tuple(self.sensors), self.chosen)
        extra = np.einsum("snq,sq->sn", raw, self.taken * self.gamma)
        return {s: columns @ t.after.declared + extra[i] for i, (s, t) in enumerate(self.sensors.items())}
