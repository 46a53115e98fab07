"""How precise a calibration will be, from its design and the errors one expects, before the night is spent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitter.errors import FitError
from fitter.quantiles import t_limit
from procedures.attitude.model import attitude_columns, variance_function
from procedures.attitude.settings import PitchRollProcedure
from procedures.kind import Procedure
from procedures.pressure.settings import WholePlotProcedure
from procedures.run_list import RunList
from rig.errors import ConfigurationError

Array = np.ndarray[Any, np.dtype[np.float64]]

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
        further: what else can be said, a sentence each.

    """

    columns: tuple[str, ...]
    rows: Sequence[Mapping[str, Any]]
    cells: Sequence[tuple[str, ...]]
    assuming: str
    further: tuple[str, ...] = ()


def precision(procedure: Procedure, run_list: RunList) -> Precision:
    """Predicted precision of a procedure's calibration.

    Raises:
        ConfigurationError: the design does not determine the model.

    """
    try:
        if isinstance(procedure, WholePlotProcedure):
            return _of_terms(procedure, run_list)
        return _of_angles(procedure, run_list)
    except FitError as error:
        smaller = ", or plan a smaller model ([model] formula)" if isinstance(procedure, WholePlotProcedure) else ""
        raise ConfigurationError(
            f"the design does not determine a sensor: {error}; visit more settings{smaller}"
        ) from error


def _of_angles(procedure: PitchRollProcedure, run_list: RunList) -> Precision:
    """Of a sensor's calibrated output at a few pitch angles (eqs. 52 and 72), roll 0."""
    setpoints = np.array([p.setpoints for p in run_list.points])
    roll = bool(np.ptp(setpoints[:, 1]))
    angles = [a for a in AT_DEG if a <= np.abs(setpoints[:, 0]).max()]
    design = attitude_columns(setpoints[:, 0], setpoints[:, 1], roll=roll)
    at = attitude_columns(np.array(angles), np.zeros(len(angles)), roll=roll)
    sigma = procedure.expect.sigma_deg
    sd = sigma * np.sqrt(variance_function(design, at))
    df = len(design) - design.shape[1]
    reach = t_limit(0.95, df) if df > 0 else float("nan")
    return Precision(
        ("pitch / deg", "sd of the calibrated output / deg", "95 % interval / deg"),
        [
            {"pitch_deg": a, "sd_deg": float(s), "interval95_deg": reach * float(s)}
            for a, s in zip(angles, sd, strict=True)
        ],
        [(f"{a:g}", f"{s:.2e}", f"+-{reach * s:.2e}") for a, s in zip(angles, sd, strict=True)],
        f"if one observation has a standard error of {sigma:.1e} deg, expect.sigma_deg",
    )


def _of_terms(procedure: WholePlotProcedure, run_list: RunList) -> Precision:
    """Of each term of the pressure model, as what it changes from the middle of the design to its end."""
    from fitter.split_plot import plan_precision  # noqa: PLC0415
    from procedures.pressure.fit import named_formula  # noqa: PLC0415

    expect = procedure.expect
    set_to = np.array([p.setpoints for p in run_list.points])
    middle, half = (set_to.max(axis=0) + set_to.min(axis=0)) / 2.0, np.ptp(set_to, axis=0) / 2.0
    half = np.where(half > 0, half, 1.0)
    coded = (set_to - middle) / half
    whole_plot = np.array([p.whole_plot for p in run_list.points])
    formula = named_formula(procedure.declared_model)
    names, columns = formula.columns(dict(zip(_VARIABLES, coded.T, strict=True)))
    found = plan_precision(columns, whole_plot, expect.sigma_wholeplot_mV, expect.sigma_subplot_mV, names)
    sensitivity = expect.sensitivity_mV_per_psi
    rows = [
        {
            "term": name,
            "stratum": "whole plot" if _shared(columns[:, i], whole_plot) else "subplot",
            "sd_mV": float(found.stderr[i]),
            "sd_psi": float(found.stderr[i]) / sensitivity,
            "df": float(found.df[i]) if np.isfinite(found.df[i]) else None,
        }
        for i, name in enumerate(names)
    ]
    cells = [
        (
            str(row["term"]),
            str(row["stratum"]),
            f"{row['sd_mV']:.2e}",
            f"{row['sd_psi']:.2e}",
            "-" if row["df"] is None else f"{row['df']:.0f}",
        )
        for row in rows
    ]
    pressures = sorted({p for p in set_to[:, 0] if p > 0})[:3]
    further = [
        _known_to(psia, procedure, found.covariance, lambda p: formula.columns(_at(p, middle, half))[1][0])
        for psia in pressures
    ]
    return Precision(
        ("term", "stratum", "sd / mV", "sd / psi", "df"),
        rows,
        cells,
        "each variable coded from -1 to 1 over the design; if temperature changes have an error of "
        f"{expect.sigma_wholeplot_mV:g} mV and observations one of {expect.sigma_subplot_mV:g} mV: "
        "expect.sigma_wholeplot_mV, sigma_subplot_mV",
        tuple(further),
    )


_VARIABLES = ("P", "T_sensor", "T_SSE")


def _at(psia: float, middle: Array, half: Array) -> dict[str, Array]:
    """One coded setting: a pressure at the middle of both temperatures."""
    coded = (np.array([psia, middle[1], middle[2]]) - middle) / half
    return {name: np.array([value]) for name, value in zip(_VARIABLES, coded, strict=True)}


def _known_to(psia: float, procedure: WholePlotProcedure, covariance: Array, columns: Callable[[float], Array]) -> str:
    """How well a pressure will be known in use, with and without a zero read in vacuum first."""
    expect, h, h_0 = procedure.expect, columns(psia), columns(0.0)
    shared, own = expect.sigma_wholeplot_mV**2, expect.sigma_subplot_mV**2
    plain = shared + own + float(h @ covariance @ h)
    zeroed = 2.0 * own + float((h - h_0) @ covariance @ (h - h_0))
    pct = [196.0 * np.sqrt(v) / expect.sensitivity_mV_per_psi / psia for v in (plain, zeroed)]
    return f"{psia:g} psia in use: +-{pct[0]:.2g} %; after reading the zero in vacuum +-{pct[1]:.2g} % (95 % intervals)"


def _shared(column: Array, whole_plot: np.ndarray[Any, Any]) -> bool:
    """Whether a column is constant in every whole plot."""
    return all(float(np.ptp(column[whole_plot == w])) == 0.0 for w in np.unique(whole_plot))
