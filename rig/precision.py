"""How precise a calibration will be, from its design and the errors one expects, before the night is spent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitter import attitude_columns, variance_function
from procedures import PitchRollProcedure, Procedure, RunList, WholePlotProcedure
from rig.errors import ConfigurationError

AT_DEG = (0.0, 10.0, 30.0, 60.0, 90.0)
"""Pitch angles at which the precision of an attitude sensor is said; those inside the design are shown."""


@dataclass(frozen=True)
class Precision:
    """Predicted precision as a table.

    Attributes:
        columns: headings, units included.
        rows: JSON-ready, one a line.
        cells: the same as text.
        assuming: what it stands on, a sentence.

    """

    columns: tuple[str, ...]
    rows: Sequence[Mapping[str, Any]]
    cells: Sequence[tuple[str, ...]]
    assuming: str


def precision(procedure: Procedure, run_list: RunList) -> Precision:
    """Predicted precision of a procedure's calibration.

    Raises:
        ConfigurationError: the design does not determine the model.

    """
    try:
        if isinstance(procedure, WholePlotProcedure):
            return _of_terms(procedure, run_list)
        return _of_angles(procedure, run_list)
    except ValueError as error:
        raise ConfigurationError(f"the design does not determine a sensor: {error}; visit more settings") from error


def _of_angles(procedure: PitchRollProcedure, run_list: RunList) -> Precision:
    """Of a sensor's calibrated output at a few pitch angles (eqs. 52 and 72), roll 0."""
    setpoints = np.array([p.setpoints for p in run_list.points])
    roll = bool(np.ptp(setpoints[:, 1]))
    angles = [a for a in AT_DEG if a <= np.abs(setpoints[:, 0]).max()]
    design = attitude_columns(setpoints[:, 0], setpoints[:, 1], roll=roll)
    at = attitude_columns(np.array(angles), np.zeros(len(angles)), roll=roll)
    sigma = procedure.expect.sigma_deg
    sd = sigma * np.sqrt(variance_function(design, at))
    return Precision(
        ("pitch / deg", "sd of the calibrated output / deg", "95 % interval / deg"),
        [
            {"pitch_deg": a, "sd_deg": float(s), "interval95_deg": 1.96 * float(s)}
            for a, s in zip(angles, sd, strict=True)
        ],
        [(f"{a:g}", f"{s:.2e}", f"+-{1.96 * s:.2e}") for a, s in zip(angles, sd, strict=True)],
        f"if one observation has a standard error of {sigma:.1e} deg, expect.sigma_deg",
    )


def _of_terms(procedure: WholePlotProcedure, run_list: RunList) -> Precision:
    """Of each coefficient of the pressure model, and of what it changes between the middle and the end of its range."""
    from fitter.pressure import named_formula  # noqa: PLC0415 - not needed where nothing is in whole plots
    from fitter.split_plot import plan_precision  # noqa: PLC0415

    expect = procedure.expect
    set_to = np.array([p.setpoints for p in run_list.points])
    table = dict(zip(("P", "T_sensor", "T_SSE"), set_to.T, strict=True))
    whole_plot = np.array([p.whole_plot for p in run_list.points])
    names, columns = named_formula(expect.model).columns(table)
    found = plan_precision(columns, whole_plot, expect.sigma_wholeplot_mV, expect.sigma_subplot_mV, names)
    rows, cells = [], []
    for i, name in enumerate(names):
        sd, df = float(found.stderr[i]), float(found.df[i])
        half = 1.0 if name == "1" else float(np.ptp(columns[:, i])) / 2.0
        whole = _shared(columns[:, i], whole_plot)
        rows.append(
            {
                "term": name,
                "stratum": "whole plot" if whole else "subplot",
                "sd": sd,
                "df": df if np.isfinite(df) else None,
                "sd_over_half_range_mV": sd * half,
                "sd_over_half_range_psi": sd * half / expect.sensitivity_mV_per_psi,
            }
        )
        cells.append(
            (
                name,
                str(rows[-1]["stratum"]),
                f"{sd:.2e}",
                f"{df:.1f}" if np.isfinite(df) else "-",
                f"{sd * half:.2e}",
                f"{sd * half / expect.sensitivity_mV_per_psi:.2e}",
            )
        )
    return Precision(
        ("term", "stratum", "sd / (mV per unit)", "df", "sd over half its range / mV", "the same / psi"),
        rows,
        cells,
        f"if temperature changes have an error of {expect.sigma_wholeplot_mV:g} mV and observations one of "
        f"{expect.sigma_subplot_mV:g} mV (expect.sigma_wholeplot_mV, sigma_subplot_mV)",
    )


def _shared(column: np.ndarray[Any, np.dtype[np.float64]], whole_plot: np.ndarray[Any, Any]) -> bool:
    """Whether a column is constant in every whole plot."""
    return all(float(np.ptp(column[whole_plot == w])) == 0.0 for w in np.unique(whole_plot))
