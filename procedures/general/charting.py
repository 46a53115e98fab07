"""Control charts of a column of any tables: its values at places of the range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from procedures.charting import Calibrations, Shown, View
from procedures.errors import DataError
from procedures.general.history import curve_charted
from procedures.general.infer import CurveCalibration
from procedures.table import Table
from procedures.unused import unit_of


class GeneralCharting:
    """See `procedures.charting.Charting`."""

    at_one_temperature = False

    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """A table does not define response and formula; a calibration file does."""
        raise DataError(
            f"Make a calibration of any other table first, rig fit {table.source} --response Y --formula '1 + X' --out "
            f"C.json, and chart C.json@DATE"
        )

    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Such a calibration has no date of its own."""
        curve, simulated = CurveCalibration.from_dict(content["calibration"]), bool(content["data"].get("simulated"))
        name = curve.response
        return Calibrations({name: curve}, {name: ()}, simulated, {"file": PurePath(source).name})

    def model(self, sensor: CurveCalibration) -> str:
        """Its formula."""
        return str(sensor.formula)

    def apart(self, first: CurveCalibration, later: CurveCalibration, between: str) -> str:
        """Calibrations of one formula can be compared."""
        return ""

    def same(self, first: CurveCalibration, later: CurveCalibration) -> bool:
        """By their coefficients."""
        return np.array_equal(first.coefficients, later.coefficients)

    def at(self, sensor: CurveCalibration, degC: float) -> CurveCalibration:
        """No temperature is known to be relevant."""
        return sensor

    def view(self, every: Sequence[CurveCalibration], years: FloatArray, usage: float | None) -> View:
        """Use over the common range of all calibrations."""
        if usage is not None:
            raise DataError("--usage is a range of pitch; others are charted over the range calibrated")
        charted, last = curve_charted(every, years), every[-1]
        plots = any(len(fit.variances) > 1 for fit in every)
        unit = unit_of(last.response)
        return View(
            charted=charted,
            shown={name: Shown(name, 1.0, unit or f"in {last.response}") for name in charted.names},
            rows=charted.rows,
            model=str(last.formula),
            unit=unit or last.response,
            drawn=(unit or last.response, 1.0),
            usage=(charted.low, charted.high),
            usage_words=f"{last.variable} {charted.low:g} to {charted.high:g}",
            interval=charted.interval,
            remarks=["the calibrations' whole plots are taken to be of one design"] if plots else [],
        )


CHARTING = GeneralCharting()
