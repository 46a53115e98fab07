"""Control charts of pressure transducers: intercept and gain at the centre temperatures.

The error within a calibration is that of the split-plot fit, whole-plot errors included, on Kenward and Roger's
degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.history import Charted, Series
from rig.fitter.split_plot import SplitPlotFit
from rig.procedures.errors import DataError
from rig.procedures.evaluate.charting import Calibrations, Charting, Shown, View
from rig.procedures.pressure.fit import PressureFit
from rig.procedures.pressure.fitted import fit_whole_plots
from rig.procedures.tables.table import Table

NAMES = ("intercept_mV", "gain_mV_per_psi")


@dataclass(frozen=True, eq=False)
class PressureCharted(Charted):
    """Intercept and gain over the calibrated range of pressure, at the centre temperatures.

    Attributes:
        highest_psia: highest common pressure of all calibrations.
        centre_degC: sensor and SSE temperature.
        interval_psi: half-width of the last calibration's 95 % interval of one reading after a change of temperature.
    """

    highest_psia: float
    centre_degC: tuple[float, float]
    interval_psi: float

    def output_rows(self) -> FloatArray:
        """(2, 2) derivatives of the output, psi, by intercept and gain, at zero and at the highest pressure."""
        return np.array([[1.0, 0.0], [1.0, self.highest_psia]]) / self.sensitivity


def pressure_charted(fits: Sequence[PressureFit], years: FloatArray) -> PressureCharted:
    """Charted parameters of one transducer.

    Args:
        fits: m of them, of one model, in order of time.
        years: (m,) since the first.

    Raises:
        FitError: the calibrations are of different models, or fewer than two.
    """
    models = sorted({str(f.formula) for f in fits})
    if len(models) > 1:
        raise FitError(f"calibrations of different models cannot be charted together: {'; '.join(models)}")
    tables = [f.problem.data.nominal for f in fits]
    highest = min(float(t["P"].max()) for t in tables)
    centre = [float(np.mean([0.5 * (t[n].min() + t[n].max()) for t in tables])) for n in ("T_sensor", "T_SSE")]
    at = {"P": np.array([0.0, highest]), "T_sensor": np.full(2, centre[0]), "T_SSE": np.full(2, centre[1])}
    rows = fits[0].formula.columns(at)[1]
    directions = np.array([rows[0], (rows[1] - rows[0]) / highest])
    values = np.array([directions @ f.reml.coefficients for f in fits])
    remls = [f.reml for f in fits]

    def variance_of(weights: FloatArray) -> tuple[FloatArray, float]:
        variance, df = _within(remls, weights @ directions)
        return np.full(len(fits), variance), df

    series = tuple(Series(years, values[:, i], *variance_of(unit)) for i, unit in enumerate(np.eye(len(NAMES))))
    gain = float(values[:, 1].mean())
    interval = fits[-1].reml.interval(rows, new_whole_plot=True, new_readings=1.0)
    return PressureCharted(
        names=NAMES,
        series=series,
        shown=NAMES,
        parameters=values,
        stderr=np.sqrt(np.column_stack([s.variance for s in series])),
        sensitivity=gain,
        replicated=True,
        variance_of=variance_of,
        highest_psia=highest,
        centre_degC=(centre[0], centre[1]),
        interval_psi=float(interval.max() / abs(gain)),
    )


def _within(fits: Sequence[SplitPlotFit], direction: FloatArray) -> tuple[float, float]:
    """Variance within calibrations of `direction` @ coefficients and its degrees of freedom, pooled; for one common
    design.
    """
    own = np.concatenate([fit.variance(direction) for fit in fits])
    df = np.concatenate([fit.df_of(direction) for fit in fits])
    return float(df @ own / df.sum()), float(df.sum())


class PressureCharting(Charting):
    """Control charts of pressure transducers."""

    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """Calibrate every sensor of a table."""
        fits = fit_whole_plots(table, formula).fits
        return Calibrations(fits, dict.fromkeys(fits, ()), table.simulated, table.provenance)

    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Calibration files do not have the required data."""
        raise DataError(
            f"{source} does not keep all that charting whole plots needs; give the run file or table instead"
        )

    def same(self, first: PressureFit, later: PressureFit) -> bool:
        """Not compared: runs are distinguished by their names."""
        return False

    def view(self, every: Sequence[PressureFit], years: FloatArray, usage: float | None) -> View:
        """Use over the common pressures of all calibrations."""
        if usage is not None:
            raise DataError("--usage is a range of pitch; others are charted over the range calibrated")
        charted = pressure_charted(every, years)
        sensor, sse = charted.centre_degC
        how = Shown("intercept", 1e3, "uV"), Shown("gain", 1e6 / charted.sensitivity, "ppm")
        return View(
            charted=charted,
            shown=dict(zip(NAMES, how, strict=True)),
            rows=charted.output_rows(),
            model=str(every[-1].formula),
            unit="psi",
            drawn=("1e-3 psi", 1e3),
            usage=(0.0, charted.highest_psia),
            usage_words=f"0 to {charted.highest_psia:g} psia at {sensor:.3g} degC (sensor) and {sse:.3g} degC (SSE)",
            interval=charted.interval_psi,
        )
