"""Errors in percent of the reading, by pressure: the criterion of low-range calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray

PAPER_SENSITIVITY_MV_PER_PSI = 2.0
"""The paper's divisor for conversion of mV to psi."""


@dataclass(frozen=True, eq=False)
class ReadingError:
    """One row for each nominal pressure, all in percent of it. NaN at zero pressure.

    Attributes:
        pressure_psia: (m,) nominal pressures, ascending.
        count: (m,) readings at each.
        max_pct: (m,) largest marginal residual, max |V - x b| / (S P): whole-plot predictions are not subtracted.
        rms_pct: (m,) root mean square of them.
        median_pct: (m,) median of their sizes.
        bias_pct: (m,) mean of V - x b over S P (eq. 12): the mean error at that pressure.
        width_pct: (m,) full width of the 95 % prediction interval over S P (eq. 11), mean over the temperatures.
    """

    pressure_psia: FloatArray
    count: IntArray
    max_pct: FloatArray
    rms_pct: FloatArray
    median_pct: FloatArray
    bias_pct: FloatArray
    width_pct: FloatArray

    def to_dict(self) -> dict[str, list[float | None]]:
        """JSON values, column by column; None at zero pressure."""
        return {
            "pressure_psia": self.pressure_psia.tolist(),
            "count": self.count.tolist(),
            **{
                name: [float(v) if np.isfinite(v) else None for v in getattr(self, name)]
                for name in ("max_pct", "rms_pct", "median_pct", "bias_pct", "width_pct")
            },
        }


def reading_error(
    residuals_mV: FloatArray,
    half_width_mV: FloatArray,
    pressure_psia: FloatArray,
    sensitivity_mV_per_psi: FloatArray,
    levels: tuple[FloatArray, IntArray],
) -> ReadingError:
    """Reading error of n residuals.

    Args:
        residuals_mV: (n,) marginal residuals.
        half_width_mV: (n,) of the prediction interval at each reading.
        pressure_psia: (n,) applied pressure; zero or less is excluded.
        sensitivity_mV_per_psi: (n,) dV/dP there.
        levels: nominal pressures (m,), and the index of each reading's (n,).
    """
    nominal, level = levels
    with np.errstate(divide="ignore", invalid="ignore"):
        pct = 100.0 * np.where(pressure_psia > 0, 1.0 / (sensitivity_mV_per_psi * pressure_psia), np.nan)
    error, width = residuals_mV * pct, 2.0 * half_width_mV * np.abs(pct)
    groups = [level == i for i in range(len(nominal))]
    return ReadingError(
        pressure_psia=nominal,
        count=np.bincount(level, minlength=len(nominal)),
        max_pct=np.array([np.abs(error[at]).max() for at in groups]),
        rms_pct=np.array([np.sqrt(np.mean(error[at] ** 2)) for at in groups]),
        median_pct=np.array([np.median(np.abs(error[at])) for at in groups]),
        bias_pct=np.array([error[at].mean() for at in groups]),
        width_pct=np.array([width[at].mean() for at in groups]),
    )
