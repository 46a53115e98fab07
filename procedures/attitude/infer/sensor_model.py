"""One sensor of a package for inference: the declared model, and further terms of gravity and temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.model import COLUMNS, sensitive_axis


@dataclass(frozen=True)
class Term:
    """A column beyond the declared model: g_x^i g_y^j g_z^k (T - T_ref)^d, gravity in g in package axes.

    Sensor nonlinearity, cross-axis sensitivity and the sag of isolation pads are such products, and so are the
    temperature coefficients of offset (d alone) and sensitivity.

    Attributes:
        powers: (i, j, k).
        degC: d.
        effect: name of its effect.
    """

    powers: tuple[int, int, int]
    degC: int = 0
    effect: str = ""

    def __post_init__(self) -> None:
        if len(self.powers) != 3 or min(*self.powers, self.degC) < 0:
            raise FitError(f"a term has three powers of gravity and one of temperature, none negative: {self}")

    def column(self, g: FloatArray, warmth: FloatArray) -> FloatArray:
        """(n,) values at (3, n) gravity and (n,) temperature above the reference."""
        out = np.asarray(warmth**self.degC) if self.degC else np.ones(g.shape[1])
        for component, power in zip(g, self.powers, strict=True):
            if power:
                out = out * component**power
        return out


@dataclass(frozen=True, eq=False)
class SensorModel:
    """One sensor: v = b + m . g_M, and further terms.

    Attributes:
        name: column name of its output.
        axis: "x", "y" or "z", its nominal axis.
        coefficients: (4 + q,) of `rig.procedures.attitude.model.COLUMNS` and of `terms`, V. Third: 0 without roll.
        sigma_V: standard deviation of one reading, sigma_E of the calibration.
        df: its degrees of freedom.
        terms: q further terms: effects found by a trace, temperature coefficients.
    """

    name: str
    axis: str
    coefficients: FloatArray
    sigma_V: float
    df: float
    terms: tuple[Term, ...] = ()

    def __post_init__(self) -> None:
        coefficients = np.array(self.coefficients, np.float64)
        coefficients.flags.writeable = False
        object.__setattr__(self, "coefficients", coefficients)
        if self.axis not in ("x", "y", "z"):
            raise FitError(f"{self.name} is along {self.axis!r}, not x, y or z")
        if coefficients.shape != (len(COLUMNS) + len(self.terms),) or not np.all(np.isfinite(coefficients)):
            raise FitError(
                f"{self.name}: expected {len(COLUMNS)} coefficients and {len(self.terms)} of further terms, all finite"
            )
        if not (self.sigma_V > 0 and np.isfinite(self.sigma_V) and self.df > 0):
            raise FitError(f"{self.name}: the calibration leaves nothing to estimate its error from")
        if not np.any(coefficients[1:4]):
            raise FitError(f"{self.name}: a sensor without sensitivity gives no attitude")

    @property
    def sensitive_axis(self) -> FloatArray:
        """(3,) sensitive axis times sensitivity, V/g in package axes."""
        return sensitive_axis(self.coefficients[: len(COLUMNS)])

    @property
    def needs_temperature(self) -> bool:
        """Whether one of the terms is a function of temperature."""
        return any(term.degC for term in self.terms)

    def rows(self, g: FloatArray, warmth: FloatArray) -> FloatArray:
        """(4 + q, n) columns of the model at (3, n) gravity and (n,) temperature above the reference."""
        base = np.stack([np.ones(g.shape[1]), g[0], -g[1], -g[2]])
        return np.concatenate([base, [t.column(g, warmth) for t in self.terms]]) if self.terms else base

    def beyond(self, g: FloatArray, warmth: FloatArray) -> FloatArray:
        """(n,) contribution of the further terms, V."""
        out = np.zeros(g.shape[1])
        for term, value in zip(self.terms, self.coefficients[len(COLUMNS) :], strict=True):
            out += value * term.column(g, warmth)
        return out

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "name": self.name,
            "axis": self.axis,
            "coefficients": self.coefficients.tolist(),
            "sigma_V": self.sigma_V,
            "df": self.df,
            "terms": [{"powers": list(t.powers), "degC": t.degC, "effect": t.effect} for t in self.terms],
        }
