"""Control charts of pressure transducers: intercept and gain at the centre temperatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fitter.arrays import FloatArray
from procedures.charting import Calibrations, Shown, View
from procedures.errors import DataError
from procedures.pressure.evaluate import fit_whole_plots
from procedures.pressure.fit import PressureFit
from procedures.pressure.history import NAMES, pressure_charted
from procedures.table import Table


class PressureCharting:
    """See `procedures.charting.Charting`."""

    at_one_temperature = False

    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """See `Charting`."""
        fits = fit_whole_plots(table, formula).fits
        return Calibrations(fits, dict.fromkeys(fits, ()), table.simulated, table.provenance)

    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Calibration files do not have the required data."""
        raise DataError(
            f"{source} does not keep all that charting whole plots needs; give the run file or table instead"
        )

    def model(self, sensor: PressureFit) -> str:
        """Its formula."""
        return str(sensor.formula)

    def apart(self, first: PressureFit, later: PressureFit, between: str) -> str:
        """Calibrations of one formula can be compared."""
        return ""

    def same(self, first: PressureFit, later: PressureFit) -> bool:
        """Not compared: runs are distinguished by their names."""
        return False

    def at(self, sensor: PressureFit, degC: float) -> PressureFit:
        """Parameters are at the centre temperatures of all calibrations anyway."""
        return sensor

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


CHARTING = PressureCharting()
