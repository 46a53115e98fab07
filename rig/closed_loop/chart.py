"""Control charts over several calibrations: is a sensor drifting, and when is it due again?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.history import Between, Calibrated, Chart, Quantities, chart, quantities
from fitter.quantiles import t_limit
from rig.closed_loop.chart_inputs import Given, notes
from rig.closed_loop.chart_json import quantity_json
from rig.closed_loop.chart_words import due_sentence, quantity_sentences
from rig.errors import UsageError

DAYS = 365.25
_PITCHES, _ROLLS = 5, 12
_TOLERANCES = (0.5, 1.0, 2.0, 4.0)
"""Of the tolerance asked for, to show how the due date depends on it."""


@dataclass(frozen=True, eq=False)
class SensorChart:
    """One sensor over its calibrations.

    Attributes:
        name: column name of its output.
        given: its calibrations, in order of time.
        quantities: what is charted, and the paper's parameters.
        chart: what was found.
        usage_deg: range of pitch that the error of the output is bounded over.
        tolerance_deg: of the output.
        told: whether the tolerance was asked for; else it is what one reading's 95 % interval already allows.
        today: when "in N days" counts from.

    """

    name: str
    given: Sequence[Given]
    quantities: Quantities
    chart: Chart
    usage_deg: tuple[float, float]
    tolerance_deg: float
    told: bool
    today: datetime

    @property
    def last(self) -> datetime:
        """When the last calibration was."""
        return self.given[-1].when

    def due(self, tolerance_deg: float) -> dict[str, Any]:
        """When the last calibration is due again for a tolerance: a status and, where there is one, a date.

        "too few": fewer than three calibrations. "never within": not even at once. "due": on a date to come.
        "overdue": on a date that has passed. `at_least` says that the forecast ends there, not the tolerance.
        """
        answer: dict[str, Any] = {"tolerance_deg": tolerance_deg}
        bound = self.chart.bound
        if bound is None:
            return {**answer, "status": "too few"}
        years = bound.holds_for(tolerance_deg)
        by_kind = {kind.value: self._date(bound.holds_for(tolerance_deg, kind)) for kind in Between}
        if years is None:
            at_once = max(float(b[0]) for b in bound.bounds.values())
            return {**answer, "status": "never within", "bound_at_once_deg": at_once, "by_variation": by_kind}
        days = int(np.floor((self.last + timedelta(days=DAYS * years) - self.today) / timedelta(days=1)))
        return {
            **answer,
            "status": "due" if days >= 0 else "overdue",
            "date": self._date(years),
            "days": days,
            "at_least": years >= float(bound.years[-1]),
            "governs": bound.governs(tolerance_deg).value,
            "by_variation": by_kind,
        }

    def _date(self, years: float | None) -> str | None:
        return None if years is None else f"{self.last + timedelta(days=DAYS * years):%Y-%m-%d}"

    def to_json(self) -> dict[str, Any]:
        """What `rig chart --json` prints of this sensor."""
        table = self.quantities
        dates = [one.date for one in self.given]
        due = self.due(self.tolerance_deg)
        result: dict[str, Any] = {
            "model": self.given[-1].sensors[self.name].model,
            "calibrations": [
                {
                    "date": one.date,
                    "file": one.source,
                    "run_id": one.provenance.get("run_id"),
                    "sensor_temperature_degC": one.degC,
                    "parameters": {
                        name: {"estimate": float(value), "stderr": float(error)}
                        for name, value, error in zip(table.names, table.parameters[i], table.stderr[i], strict=True)
                    },
                    "outside": self._outside(i),
                }
                for i, one in enumerate(self.given)
            ],
            "quantities": {q.name: quantity_json(q, dates) for q in self.chart.quantities},
            "errors_from_replications": table.replicated,
            "usage_deg": list(self.usage_deg),
            "tolerance_asked_for": self.told,
            "due": due,
            "due_by_tolerance": [self.due(factor * self.tolerance_deg) for factor in _TOLERANCES],
        }
        if self.chart.bound is not None:
            bound = self.chart.bound
            result["error_bound"] = {
                "days": [float(DAYS * y) for y in bound.years],
                **{f"{kind.value}_deg": [float(v) for v in values] for kind, values in bound.bounds.items()},
            }
        sentences = [f"{self.name}: {text}" for text in quantity_sentences(self.chart, dates, table.S_V)]
        return {**result, "sentences": [*sentences, f"{self.name}: {due_sentence(due, len(dates), self.told)}"]}

    def _outside(self, i: int) -> dict[str, str]:
        """Parameters of calibration `i` outside their limits: "95 %" or "99.7 %"."""
        found = {}
        for q in self.chart.quantities:
            if q.limits is not None and q.limits.warned[i]:
                found[q.name] = "99.7 %" if q.limits.out[i] else "95 %"
        return found


@dataclass(frozen=True, eq=False)
class Charted:
    """All sensors of a set of calibrations.

    Attributes:
        given: the calibrations, in order of time.
        sensors: by output column.
        notes: what a reader should know.

    """

    given: Sequence[Given]
    sensors: Mapping[str, SensorChart]
    notes: Sequence[str]

    @property
    def simulated(self) -> bool:
        """Whether all of it is from simulated runs."""
        return self.given[0].simulated

    def to_json(self) -> dict[str, Any]:
        """What `rig chart --json` prints."""
        return {
            "data": {
                "kind": "pitch-roll",
                "simulated": self.simulated,
                "calibrations": [
                    {"file": one.source, "date": one.date, **{k: v for k, v in one.provenance.items() if k != "file"}}
                    for one in self.given
                ],
            },
            "notes": list(self.notes),
            "sensors": {name: sensor.to_json() for name, sensor in self.sensors.items()},
        }


def chart_calibrations(
    given: Sequence[Given],
    today: datetime,
    *,
    sensors: Sequence[str] = (),
    tolerance_deg: float | None = None,
    usage_deg: float | None = None,
) -> Charted:
    """Chart every sensor that is in all calibrations.

    Args:
        given: at least two calibrations, in order of time.
        today: when "in N days" counts from.
        sensors: names of the outputs to chart; none for all.
        tolerance_deg: of the output; None for the 95 % interval of one reading.
        usage_deg: pitch within +- this; None for the range calibrated last.

    Raises:
        UsageError: a sensor is not in all calibrations, or was calibrated by different models.

    """
    common = [name for name in given[0].sensors if all(name in one.sensors for one in given)]
    for name in sensors:
        for one in given:
            if name not in one.sensors:
                raise UsageError(f"{one.source} has no sensor {name}; it has {', '.join(one.sensors)}")
    if not common:
        raise UsageError(
            f"no sensor is in all of these calibrations: {given[0].source} has {', '.join(given[0].sensors)}"
        )
    remarks = notes(given)
    if not sensors:
        left = sorted({name for one in given for name in one.sensors} - set(common))
        remarks += [f"{name} is not in all of these calibrations and is left out" for name in left]
    years = np.array([(one.when - given[0].when) / timedelta(days=DAYS) for one in given])
    found = {}
    for name in dict.fromkeys(sensors or common):
        _check_alike(name, given)
        every = [one.sensors[name] for one in given]
        charted = quantities(every, years)
        low, high = every[-1].pitch_range_deg
        usage = (low, high) if usage_deg is None else (-usage_deg, usage_deg)
        pitch, roll = _attitudes(usage, roll=every[-1].model != "attitude-no-roll")
        rows = charted.output_rows(pitch, roll)
        found[name] = SensorChart(
            name=name,
            given=given,
            quantities=charted,
            chart=chart([q.name for q in charted.quantities], charted.series, rows),
            usage_deg=usage,
            tolerance_deg=_interval_deg(every[-1], charted, pitch, roll) if tolerance_deg is None else tolerance_deg,
            told=tolerance_deg is not None,
            today=today,
        )
        if usage[0] < low - 1e-9 or usage[1] > high + 1e-9:
            remarks.append(f"{name}: +-{usage_deg:g} deg is more than was calibrated last ({low:g} to {high:g} deg)")
        if not charted.replicated:
            remarks.append(
                f"{name}: no calibration has two replications that can be fitted alone; errors within calibrations "
                f"are those of the residuals, and too small if anything drifted during one"
            )
    return Charted(given, found, remarks)


def _check_alike(name: str, given: Sequence[Given]) -> None:
    first = given[0]
    for one in given[1:]:
        models = first.sensors[name].model, one.sensors[name].model
        if models[0] != models[1]:
            raise UsageError(
                f"{name} is {models[0]} in {first.source} and {models[1]} in {one.source}: only calibrations of one "
                f"model can be charted together"
            )
        effects = [", ".join(dict.fromkeys(each.effects[name])) or "none" for each in (first, one)]
        if effects[0] != effects[1]:
            raise UsageError(
                f"{name} was fitted with effects beside the model in one calibration and not in the other "
                f"({first.source}: {effects[0]}; {one.source}: {effects[1]}): fit all of them alike"
            )


def _attitudes(usage_deg: tuple[float, float], *, roll: bool) -> tuple[FloatArray, FloatArray]:
    """(H,) pitch and roll where the error of the output is bounded; its extremes lie on this grid or close by."""
    rolls = np.arange(_ROLLS) * (360.0 / _ROLLS) if roll else np.zeros(1)
    pitch, around = np.meshgrid(np.linspace(*usage_deg, _PITCHES), rolls)
    return pitch.ravel(), around.ravel()


def _interval_deg(last: Calibrated, charted: Quantities, pitch_deg: FloatArray, roll_deg: FloatArray) -> float:
    """Half-width of the 95 % prediction interval of one reading by the last calibration, at its widest (eq. 73)."""
    rows = charted.output_rows(pitch_deg, roll_deg) @ np.array([q.direction for q in charted.quantities])
    widest = float(np.einsum("hk,kl,hl->h", rows, last.shape, rows).max())
    return t_limit(0.95, last.df_sigma) * last.sigma_V * float(np.sqrt(np.degrees(1.0 / charted.S_V) ** 2 + widest))
