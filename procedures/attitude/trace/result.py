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
from rig.fitter.trace.found import TracedRun, TracedSensor
from rig.fitter.trace.outcome import Finding, Row
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import table_2
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.temperature import Temperature
from rig.procedures.attitude.trace.alternatives import Alternative
from rig.procedures.attitude.trace.estimate import predict
from rig.procedures.attitude.trace.problem import Candidate, raw_columns
from rig.procedures.present.words import TESTS


@dataclass(frozen=True, eq=False)
class FoundEffect(Finding):
    """An effect in one attitude sensor.

    Attributes:
        columns_V: (n, q) contribution of each of its terms to the output of each observation; none of noise.
        df: degrees of freedom of its standard errors.
    """

    columns_V: FloatArray = field(default_factory=lambda: np.zeros((1, 0)), kw_only=True)
    df: float = field(default=float("nan"), kw_only=True)

    @property
    def contribution_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(n,) its contribution to the output of each observation."""
        return np.asarray(self.columns_V.sum(axis=1))

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for attitude sensors only."""
        return {} if self.kind == "noise" else {"rms_V": float(np.sqrt(np.mean(self.contribution_V**2)))}


@dataclass(frozen=True, eq=False)
class SensorTrace(TracedSensor[Replication, FoundEffect]):
    """Findings in one sensor: Table 2 before and after.

    Attributes:
        cv_rms_before: rms error of left-out replications, V; None for a single replication.
        cv_rms_after: the same after, with a search without the left-out replication.
        shared_attitude_before: agreement of commands with the same attitude; only the head can cause differences, not
            gravity.
        shared_attitude_after: the same with the effects removed.
        fit: the declared model, fitted with the effects.
        temperature: its temperature terms; None without.
        S_V: sensitivity, for conversion of volts to degrees.
        residual_before_V: (n,) residual of the declared model, in the data's order of rows.
        residual_after_V: (n,) residual with the effects.
    """

    cv_rms_before: float | None
    cv_rms_after: float | None
    shared_attitude_before: FTest
    shared_attitude_after: FTest
    fit: LinearFit
    temperature: Temperature | None
    S_V: float
    residual_before_V: FloatArray
    residual_after_V: FloatArray


def side(table: Replication, cv_rms: float | None, shared: FTest, S_V: float) -> tuple[Row, ...]:
    """Rows of a sensor's table, before or after the effects."""
    known = np.isfinite(shared.value)
    values = {
        **table_2(table, S_V),
        "cv_rms": cv_rms,
        "cv_rms_deg": None if cv_rms is None else float(np.degrees(cv_rms / S_V)),
        "T_shared_attitude": shared.value if known else None,
        "F_shared_attitude_95": shared.limit_95 if known else None,
    }
    return tuple(_row(name, value, values) for name, value in values.items())


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
class Trace(TracedRun[SensorTrace, Candidate]):
    """Findings in a run.

    Attributes:
        outliers: rows of readings that stand alone, which count as three standard deviations.
        alternatives: the effects with another member of a class in place of the named one, one for every member.
    """

    outliers: tuple[int, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    kind = "pitch-roll"

    @property
    def reference(self) -> dict[str, JsonValue]:
        """See `TracedRun`."""
        return {"temperature_degC": self.scene.temperature_degC, "elapsed_s": self.scene.elapsed_s}

    def predict(self, data: AttitudeData) -> dict[str, FloatArray]:
        """(n,) outputs of each sensor for other observations, with effects, volts."""
        extra = np.einsum("snq,sq->sn", raw_columns(self.scene.on(data), self.chosen), self.taken * self.gamma)
        h = attitude_columns(data.pitch_deg, data.roll_deg, roll=self.scene.roll)
        return {s: predict(h, data, t.fit, t.temperature) + extra[i] for i, (s, t) in enumerate(self.sensors.items())}
