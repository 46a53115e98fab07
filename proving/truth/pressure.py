"""Pressure transducers by their physics: a bridge, its amplifier and their errors, no fitted formula.

The design is that of section II.B of McCollum, Commo and Parker: a spherical central composite in the two temperatures,
with factorial points and sensor extremes twice and five more centres, and eight pressures in random order, three twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.procedures.pressure.data import WholePlotData

Array = NDArray[np.float64]

PRESSURES_PSIA = (0.01, 0.01, 0.12, 0.50, 0.79, 1.00, 2.50, 2.50, 4.00, 5.00, 5.00)
UNIT_MV = 0.00453
"""Size of the errors, chosen so that reading errors are those of the paper's figures."""
SENSOR_CENTRE_DEGC, SENSOR_REACH_DEGC, SSE_CENTRE_DEGC, SSE_REACH_DEGC = -90.0, 40.0, 0.0, 40.0


def temperature_pairs() -> Array:
    """(20, 2) sensor and SSE temperature of the whole plots."""
    corner = [(a, b) for a in (-1, 1) for b in (-1, 1)]
    coded = np.array(
        [(a * 0.5**0.5, b * 0.5**0.5) for a, b in corner * 2] + [(-1, 0), (1, 0)] * 2 + [(0, -1), (0, 1)] + [(0, 0)] * 6
    )
    return coded * [SENSOR_REACH_DEGC, SSE_REACH_DEGC] + [SENSOR_CENTRE_DEGC, SSE_CENTRE_DEGC]


@dataclass(frozen=True)
class Transducer:
    """A strain-gauge bridge and its amplifier; errors are standard deviations.

    The bridge's offset bends with its temperature, its sensitivity falls with it, the amplifier's gain drifts with its
    own: eq. (1) without two of its terms, as in section II.C. `cubic` is what eq. (1) leaves out.
    """

    offset_mV: float = 0.35
    sensitivity_mV_per_psi: float = 2.0
    offset_per_degC: float = 6e-4
    offset_per_degC2: float = 3e-6
    amplifier_offset_per_degC: float = 0.0
    cross_offset_per_degC2: float = 0.0
    sensitivity_per_degC: float = -2e-4
    gain_per_degC: float = 9e-5
    bend_per_psi: float = -1.5e-3
    cubic_mV_per_psi3: float = 0.0
    wholeplot_mV: float = 10**0.5 * UNIT_MV
    subplot_mV: float = UNIT_MV
    subplot_mV_per_psi: float = 0.0
    replicate_mV: float = 0.0

    def output_mV(self, pressure: Array | float, sensor: Array | float, sse: Array | float) -> Array:  # noqa: N802 - a unit
        """Without errors."""
        warm, hot = sensor - SENSOR_CENTRE_DEGC, sse - SSE_CENTRE_DEGC
        offset = self.offset_mV + self.offset_per_degC * warm + self.offset_per_degC2 * warm**2
        offset += self.amplifier_offset_per_degC * hot + self.cross_offset_per_degC2 * warm * hot
        sensitivity = self.sensitivity_mV_per_psi * (
            1 + self.sensitivity_per_degC * warm + self.gain_per_degC * hot + self.bend_per_psi * pressure
        )
        mV: Array = np.asarray(offset + sensitivity * pressure + self.cubic_mV_per_psi3 * pressure**3)
        return mV

    def subplot_sd(self, pressure: Array) -> Array:
        """Of readings at each pressure."""
        return self.subplot_mV + self.subplot_mV_per_psi * pressure


HOMOSCEDASTIC = Transducer()
"""Whole-plot variance ten times the subplot's."""

GROWING = Transducer(subplot_mV=0.4 * UNIT_MV, subplot_mV_per_psi=0.3 * UNIT_MV)
GROWING_AND_CUBIC = replace(GROWING, cubic_mV_per_psi3=2.5e-3)
"""With these two the paper's four methods come out as in its figures."""


def simulate(
    transducer: Transducer,
    seed: int,
    *,
    replications: int = 1,
    keep: Mapping[int, int] | None = None,
    readback_degC: float = 0.0,
) -> tuple[WholePlotData, Array]:
    """(data, whole-plot errors by row) of one run; `keep` (whole plot, how many readings it got before it broke)."""
    rng = np.random.default_rng([20120109, seed])
    pairs = temperature_pairs()
    columns: list[list[tuple[float, ...]]] = []
    for replicate in range(1, replications + 1):
        shared = rng.normal(0, transducer.replicate_mV)
        for pair in rng.permutation(pairs):
            number = len(columns) + 1
            error = shared + rng.normal(0, transducer.wholeplot_mV)
            pressures = rng.permutation(PRESSURES_PSIA)[: (keep or {}).get(number)]
            columns.append([(number, replicate, p, *pair, error) for p in pressures])
    rows = np.array([row for whole_plot in columns for row in whole_plot])
    number, replicate, pressure, sensor, sse, error = rows.T
    n = len(rows)
    clean = transducer.output_mV(pressure, sensor, sse)
    reading = clean + error + rng.normal(size=n) * transducer.subplot_sd(pressure)
    data = WholePlotData(
        whole_plot=number,
        order=np.arange(n),
        elapsed_s=np.arange(n) * 240.0 + number * 4800.0,
        pressure_psia=pressure,
        sensor_temperature_degC=sensor + rng.normal(0, readback_degC, n),
        sse_temperature_degC=sse + rng.normal(0, readback_degC, n),
        outputs={"bridge_mV": reading},
        replicate=replicate,
    )
    return data, error
