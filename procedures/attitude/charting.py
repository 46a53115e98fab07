"""Control charts of attitude sensors: offset, sensitivity, and direction of the sensitive axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.fitted import with_temperature
from rig.procedures.attitude.history import AttitudeCharted, Calibrated, attitude_charted, calibrated, calibrated_from
from rig.procedures.attitude.infer.calibrate import OFFSET, SENSITIVITY
from rig.procedures.attitude.table import attitude_data
from rig.procedures.errors import DataError
from rig.procedures.evaluate.charting import Calibrations, Charting, Shown, View
from rig.procedures.tables.table import Table

_NO_ROLL = "attitude-no-roll"
_PITCHES, _ROLLS = 5, 12
"""Attitudes for the bound of the output's error: its extremes are on this grid or close to it."""
_TURNED_DEG = 45.0
"""Limit of the angle between the sensitive axes of one sensor: a misalignment is smaller, a remounted or exchanged
sensor exceeds it.
"""


class AttitudeCharting(Charting):
    """Control charts of accelerometers, by their parameters."""

    at_one_temperature = True

    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """Calibrate every sensor of a table."""
        if formula is not None:
            raise DataError(
                f"{table.source} holds a pitch-roll calibration, whose model is its geometry; --formula is for whole "
                f"plots"
            )
        data, warm = attitude_data(table), with_temperature(table, None)
        try:
            sensors = {name: calibrated(data, name, temperature=warm) for name in data.sensors}
        except FitError as error:
            raise DataError(f"{table.source}: {error}") from error
        degC = table.columns.get("sensor_temperature_degC")
        return Calibrations(
            sensors=sensors,
            effects=dict.fromkeys(sensors, (OFFSET, SENSITIVITY) if warm else ()),
            simulated=table.simulated,
            provenance=table.provenance,
            degC=None if degC is None else float(np.mean(degC)),
            corrected=_corrected(sensors),
        )

    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Calibrations from a file of `rig fit --out` of this kind."""
        sensors, kept = calibrated_from(content), content["calibration"]
        degC = kept["reference_degC"]
        return Calibrations(
            sensors=sensors,
            effects={one["name"]: tuple(term["effect"] for term in one["terms"]) for one in kept["sensors"]},
            simulated=bool(content["data"]["simulated"]),
            provenance=content["data"],
            degC=None if degC is None else float(degC),
            corrected=_corrected(sensors),
        )

    def model(self, sensor: Calibrated) -> str:
        """The fitted model of a sensor; only calibrations of one model are charted together."""
        return sensor.model

    def apart(self, first: Calibrated, later: Calibrated, between: str) -> str:
        """Refuse a sensitive axis that was turned by more than a misalignment."""
        a, b = first.coefficients[1:], later.coefficients[1:]
        turned = np.degrees(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0)))
        if turned <= _TURNED_DEG:
            return ""
        return (
            f"its sensitive axis was turned by {turned:.0f} deg {between}: it was mounted otherwise, or is another "
            f"sensor; chart them apart"
        )

    def at(self, sensor: Calibrated, degC: float) -> Calibrated:
        """A sensor at another temperature, if it is possible."""
        return sensor.at(degC)

    def view(self, every: Sequence[Calibrated], years: FloatArray, usage: float | None) -> View:
        """With use within +- `usage` deg of pitch."""
        charted, last = attitude_charted(every, years), every[-1]
        (low, high), remarks = last.pitch_range_deg, []
        used = (low, high) if usage is None else (-usage, usage)
        if used[0] < low - 1e-9 or used[1] > high + 1e-9:
            remarks.append(f"+-{usage:g} deg is more than was calibrated last ({low:g} to {high:g} deg)")
        if not charted.replicated:
            remarks.append(
                "no calibration has two replications that can be fitted alone; errors within calibrations are those of "
                "the residuals, and too small if anything drifted during one"
            )
        rolls = np.arange(_ROLLS) * (360.0 / _ROLLS) if last.model != _NO_ROLL else np.zeros(1)
        pitch, roll = (angle.ravel() for angle in np.meshgrid(np.linspace(*used, _PITCHES), rolls))
        rows = charted.output_rows(pitch, roll)
        return View(
            charted=charted,
            shown=_shown(charted),
            rows=rows,
            model=last.model,
            unit="deg",
            drawn=("1e-4 deg", 1e4),
            usage=used,
            usage_words=f"pitch {used[0]:g} to {used[1]:g} deg",
            interval=_interval_deg(last, charted, rows),
            remarks=remarks,
        )


def _corrected(sensors: Mapping[str, Calibrated]) -> bool:
    return all(sensor.warmth is not None for sensor in sensors.values())


def _shown(charted: AttitudeCharted) -> dict[str, Shown]:
    known = {
        "b_V": Shown("offset", 1e6, "uV"),
        "S_V": Shown("sensitivity", 1e6 / charted.sensitivity, "ppm"),
        "Omega_cos_A_deg": Shown("Omega cos A", 1.0, "deg"),
        "Omega_sin_A_deg": Shown("Omega sin A", 1.0, "deg"),
        "phi_deg": Shown("misalignment phi", 1.0, "deg"),
    }
    return {name: known[name] for name in charted.names}


def _interval_deg(last: Calibrated, charted: AttitudeCharted, rows: FloatArray) -> float:
    """Half-width of the 95 % prediction interval of one reading by the last calibration, its maximum (eq. 73)."""
    rows = rows @ charted.directions
    widest = float(np.einsum("hk,kl,hl->h", rows, last.shape, rows).max())
    one = np.degrees(1.0 / charted.sensitivity) ** 2
    return t_limit(0.95, last.df_sigma) * last.sigma_V * float(np.sqrt(one + widest))
