"""Calibrations of a pressure transducer as charted values: its output at the centre temperatures, by generalised least
squares.

The error within a calibration is that of the split-plot fit, with whole-plot errors, and Kenward and Roger's degrees of
freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.errors import FitError
from fitter.history import Charted, Series
from fitter.split_plot import SplitPlotFit
from procedures.pressure.fit import PressureFit

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
