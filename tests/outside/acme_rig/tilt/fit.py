"""A straight line from the sine of pitch to the output, for every sensor of a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.linear import LinearFit, least_squares
from rig.fitter.quantiles import t_limit
from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict
from rig.procedures.evaluate.inference import Inference, empty_rows
from rig.procedures.evaluate.results import Page
from rig.procedures.present.blocks import Block, Grid, headline
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import Unused, unused_in_fit

NEEDED = ("replicate", "order", "elapsed_s", "pitch_deg", "pitch_side")
UNIT = "V"
TERMS = ("offset", "slope")


def columns(pitch_deg: FloatArray) -> FloatArray:
    """(n, 2) columns of the declared model."""
    return np.column_stack([np.ones(len(pitch_deg)), np.sin(np.radians(pitch_deg))])


def outputs(table: Table) -> Mapping[str, FloatArray]:
    """(n,) of every sensor. Raises `DataError` where the table lacks something."""
    missing = [name for name in NEEDED if name not in table.columns]
    found = {name: values for name, values in table.columns.items() if name.endswith(f"_{UNIT}")}
    if missing or not found:
        raise DataError(f"{table.source}: column {(*missing, 'NAME_V')[0]} is missing")
    return found


def unused(table: Table) -> Unused:
    """What of a table is not looked at."""
    return unused_in_fit(table, (*NEEDED, "block"), UNIT)


def about(table: Table, kind: str) -> dict[str, Any]:
    """What a result says of its data."""
    return {"points": len(table), "kind": kind, "simulated": table.simulated, **table.provenance}


@dataclass(frozen=True)
class Line:
    """The calibration of one sensor.

    Attributes:
        offset: output at level, V.
        slope: V per sine of pitch.
        covariance: (2, 2) of both.
        sigma: standard error of one observation, V.
        df: degrees of freedom.
        range_deg: pitch from here to there.

    """

    offset: float
    slope: float
    covariance: FloatArray
    sigma: float
    df: int
    range_deg: tuple[float, float]

    @classmethod
    def of(cls, fit: LinearFit, pitch_deg: FloatArray) -> Line:
        """From a fit."""
        ends = float(pitch_deg.min()), float(pitch_deg.max())
        return cls(*map(float, fit.coefficients), fit.covariance, fit.sigma, fit.df, ends)

    @classmethod
    def of_json(cls, given: Mapping[str, Any]) -> Line:
        """From what `to_json` gave."""
        offset, slope = (float(given["coefficients"][term]["estimate"]) for term in TERMS)
        low, high = given["range_deg"]
        covariance = np.array(given["covariance"], float)
        return cls(offset, slope, covariance, float(given["sigma_V"]), int(given["df"]), (float(low), float(high)))

    @property
    def sigma_deg(self) -> float:
        """Standard error of one observation as an angle near level."""
        return float(np.degrees(self.sigma / abs(self.slope)))

    def to_json(self) -> dict[str, Any]:
        """What a calibration file keeps."""
        errors = np.sqrt(np.diag(self.covariance))
        values = zip(TERMS, (self.offset, self.slope), errors.tolist(), strict=True)
        coefficients = {term: {"estimate": value, "stderr": error, "df": self.df} for term, value, error in values}
        told = {"sigma_V": self.sigma, "sigma_deg": self.sigma_deg, "df": self.df, "range_deg": list(self.range_deg)}
        return {"coefficients": coefficients, "covariance": self.covariance.tolist(), **told}

    def pitch(self, volts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) pitch of one observation each, and its standard deviation; deg."""
        sine = (volts - self.offset) / self.slope
        rows = np.column_stack([np.ones(len(sine)), sine])
        variance = self.sigma**2 + np.einsum("nk,kl,nl->n", rows, self.covariance, rows)
        with np.errstate(invalid="ignore", divide="ignore"):
            pitch, per_volt = np.arcsin(sine), 1.0 / (abs(self.slope) * np.sqrt(1.0 - sine**2))
        return np.degrees(pitch), np.degrees(np.sqrt(variance) * per_volt)


@dataclass(frozen=True)
class TiltFitted:
    """Every sensor of a table. See `rig.procedures.evaluate.results.Fitted`."""

    table: Table
    kind: str
    lines: Mapping[str, Line]

    def to_json(self) -> dict[str, Any]:
        """What `rig fit --json` prints and `--out` keeps."""
        sensors = {name: line.to_json() for name, line in self.lines.items()}
        return {"data": about(self.table, self.kind), "sensors": sensors, "unused": unused(self.table).to_json()}

    def blocks(self) -> Iterator[Block]:
        """What a person reads of it."""
        yield headline(self.table.source, self.table)
        grid = Grid(("sensor", "offset / V", "slope / V", "standard error / deg"))
        for name, line in self.lines.items():
            grid.add_row(name, f"{line.offset:.6f}", f"{line.slope:.6f}", f"{line.sigma_deg:.2g}")
        yield grid

    def page(self) -> Page | None:
        """The trace has a report."""
        return None


def fit(table: Table, kind: str) -> TiltFitted:
    """Fit every sensor. Raises `DataError`."""
    read, pitch = outputs(table), table.columns.get("pitch_deg", np.zeros(0))
    try:
        fits = {name: least_squares(columns(pitch), volts, TERMS) for name, volts in read.items()}
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    return TiltFitted(table, kind, {name: Line.of(one, pitch) for name, one in fits.items()})


def judge(limit: float | None, fitted: TiltFitted) -> list[Verdict]:
    """Every sensor's standard error against a limit, deg."""
    if limit is None:
        return []
    words = f"standard error up to {limit:g} deg"
    found = {name: line.sigma_deg for name, line in fitted.lines.items()}
    return [Verdict(n, f"standard error {s:.2g} deg, limit {limit:g} deg", words, s <= limit) for n, s in found.items()]


def infer(lines: Mapping[str, Line], read: Reader) -> Inference:
    """Pitch from the first of the calibrated sensors. Raises `DataError`."""
    name, line = next(iter(lines.items()))
    table = read([name])
    pitch, sd = line.pitch(table.columns[name])
    half, flag = t_limit(0.95, line.df) * sd, empty_rows({name: table.columns[name]})
    low, high = line.range_deg
    flag[(flag == "") & ~((pitch >= low) & (pitch <= high))] = f"outside the calibrated {low:g} to {high:g} deg"
    told = {"pitch_deg": pitch, "pitch_deg_sd": sd, "pitch_deg_lo95": pitch - half, "pitch_deg_hi95": pitch + half}
    added = {**told, "flag": flag}
    return Inference({**table.columns, **added}, tuple(added), (), int(np.sum(flag != "")), ("pitch_deg",))
