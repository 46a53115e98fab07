"""All that inferring attitude from a package's outputs needs: models, joint covariance, noise, range of validity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.attitude import COLUMNS, sensitive_axis
from fitter.calibration import AttitudeFit

Range = tuple[float, float]
KIND = "attitude"


@dataclass(frozen=True)
class Term:
    """A column beyond the declared model: g_x^i g_y^j g_z^k (T - T_ref)^d, gravity in g in package axes.

    Sensor nonlinearity, cross-axis sensitivity and the sag of isolation pads are such products, and so are the
    temperature coefficients of offset (d alone) and sensitivity.

    Attributes:
        powers: (i, j, k).
        degC: d.
        effect: name of the effect it belongs to.

    """

    powers: tuple[int, int, int]
    degC: int = 0
    effect: str = ""

    def __post_init__(self) -> None:
        if len(self.powers) != 3 or min(*self.powers, self.degC) < 0:
            raise ValueError(f"a term has three powers of gravity and one of temperature, none negative: {self}")

    def column(self, g: FloatArray, warmth: FloatArray) -> FloatArray:
        """(n,) of (3, n) gravity and (n,) temperature above the reference."""
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
        coefficients: (4 + q,) of `fitter.attitude.COLUMNS` and of `terms`, V. The third is zero without roll.
        sigma_V: standard deviation of one reading, sigma_E of the calibration.
        df: its degrees of freedom.
        terms: q effects found by trace, temperature coefficients.

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
            raise ValueError(f"{self.name} is along {self.axis!r}, not x, y or z")
        if coefficients.shape != (len(COLUMNS) + len(self.terms),) or not np.all(np.isfinite(coefficients)):
            raise ValueError(
                f"{self.name}: expected {len(COLUMNS)} coefficients and {len(self.terms)} of further terms, all finite"
            )
        if not (self.sigma_V > 0 and np.isfinite(self.sigma_V) and self.df > 0):
            raise ValueError(f"{self.name}: the calibration leaves nothing to estimate its error from")
        if not np.any(coefficients[1:4]):
            raise ValueError(f"{self.name}: a sensor without sensitivity tells no attitude")

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
        """(n,) what the further terms add, V."""
        out = np.zeros(g.shape[1])
        for term, value in zip(self.terms, self.coefficients[len(COLUMNS) :], strict=True):
            out += value * term.column(g, warmth)
        return out

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.name,
            "axis": self.axis,
            "coefficients": self.coefficients.tolist(),
            "sigma_V": self.sigma_V,
            "df": self.df,
            "terms": [{"powers": list(t.powers), "degC": t.degC, "effect": t.effect} for t in self.terms],
        }


@dataclass(frozen=True, eq=False)
class AttitudeCalibration:
    """Calibration of a package.

    Attributes:
        sensors: S of them, in the order of the outputs they are given.
        covariance: (K, K) joint covariance of all coefficients, sensor by sensor, V^2.
        pitch_range_deg: lowest and highest pitch calibrated.
        roll_range_deg: the same for roll.
        roll: whether the package was calibrated with roll; without it, it is taken to stand at zero roll.
        degC_range: the same for the sensors' temperature; None where it was not recorded.
        reference_degC: temperature at which temperature terms are zero.
        notes: what a reader should know: effects that were left out, and why.
        covariance_df: degrees of freedom of the covariance where it was found by itself, from replications that drift;
            None where it scales with the sensors' sigma_V^2 and has their degrees of freedom.

    """

    sensors: tuple[SensorModel, ...]
    covariance: FloatArray
    pitch_range_deg: Range
    roll_range_deg: Range
    roll: bool = True
    degC_range: Range | None = None
    reference_degC: float | None = None
    notes: tuple[str, ...] = field(default=())
    covariance_df: float | None = None

    def __post_init__(self) -> None:
        if not self.sensors:
            raise ValueError("a calibration of no sensor tells no attitude")
        if len(set(self.names)) != len(self.sensors):
            raise ValueError(f"two sensors have the same name: {', '.join(self.names)}")
        covariance = np.array(self.covariance, np.float64)
        size = sum(s.coefficients.size for s in self.sensors)
        if covariance.shape != (size, size) or not np.all(np.isfinite(covariance)):
            raise ValueError(f"expected a finite covariance of {size} by {size}, found shape {covariance.shape}")
        values = np.linalg.eigvalsh((covariance + covariance.T) / 2)
        scale = np.abs(covariance).max(initial=0.0)
        if np.abs(covariance - covariance.T).max() > 1e-9 * scale or values[0] < -1e-9 * scale:
            raise ValueError("the covariance is not that of anything: it is not symmetric and positive")
        covariance.flags.writeable = False
        object.__setattr__(self, "covariance", covariance)
        if self.covariance_df is not None and not self.covariance_df > 0:
            raise ValueError(f"degrees of freedom are positive, those of the covariance are {self.covariance_df:g}")
        if any(s.needs_temperature for s in self.sensors) and self.reference_degC is None:
            raise ValueError("a calibration with temperature terms needs the temperature at which they are zero")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the outputs."""
        return tuple(s.name for s in self.sensors)

    @property
    def needs_temperature(self) -> bool:
        """Whether inferring needs the sensors' temperature."""
        return any(s.needs_temperature for s in self.sensors)

    @property
    def offsets_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(S,)."""
        return np.array([s.coefficients[0] for s in self.sensors])

    @property
    def matrix(self) -> FloatArray:
        """(S, 3) sensitive axes times sensitivities, V/g: outputs less offsets = matrix @ g_M."""
        return np.array([s.sensitive_axis for s in self.sensors])

    @property
    def sigma_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(S,) standard deviation of one reading."""
        return np.array([s.sigma_V for s in self.sensors])

    @cached_property
    def root(self) -> FloatArray:
        """(K, K) with root @ root.T = covariance; exists where the covariance has no full rank, too."""
        values, vectors = np.linalg.eigh(self.covariance)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    @classmethod
    def from_fits(cls, fits: Sequence[AttitudeFit]) -> AttitudeCalibration:
        """The calibration of a package whose sensors were calibrated one by one: their errors are independent.

        Args:
            fits: one a sensor, all with roll or all without.

        Raises:
            ValueError: there is none, or sensors with and without roll are mixed.

        """
        if not fits:
            raise ValueError("a calibration of no sensor tells no attitude")
        if len({f.has_roll for f in fits}) > 1:
            raise ValueError("some of the sensors were calibrated with roll, others without: calibrate them alike")
        k = len(COLUMNS)
        covariance = np.zeros((k * len(fits), k * len(fits)))
        for i, fit in enumerate(fits):
            root = fit.linear.sigma * with_roll(fit.linear.root)
            covariance[i * k : i * k + k, i * k : i * k + k] = root @ root.T
        return cls(
            sensors=tuple(
                SensorModel(f.sensor, _axis(f), with_roll(f.linear.coefficients), f.linear.sigma, f.linear.df)
                for f in fits
            ),
            covariance=covariance,
            pitch_range_deg=_common([f.pitch_range_deg for f in fits]),
            roll_range_deg=_common([f.roll_range_deg for f in fits]),
            roll=fits[0].has_roll,
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON; `from_dict` reads it back exactly."""
        return {
            "kind": KIND,
            "roll": self.roll,
            "sensors": [s.to_dict() for s in self.sensors],
            "covariance": self.covariance.tolist(),
            "covariance_df": self.covariance_df,
            "pitch_range_deg": list(self.pitch_range_deg),
            "roll_range_deg": list(self.roll_range_deg),
            "degC_range": None if self.degC_range is None else list(self.degC_range),
            "reference_degC": self.reference_degC,
            "notes": list(self.notes),
        }

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> AttitudeCalibration:
        """Read back what `to_dict` gave.

        Raises:
            ValueError: it is not such a calibration; says what is wrong.

        """
        if given.get("kind") != KIND:
            raise ValueError(f"this is not a calibration of attitude, its kind is {given.get('kind')!r}")
        try:
            sensors = tuple(
                SensorModel(
                    name=str(s["name"]),
                    axis=str(s["axis"]),
                    coefficients=np.array(s["coefficients"], np.float64),
                    sigma_V=float(s["sigma_V"]),
                    df=float(s["df"]),
                    terms=tuple(
                        Term((int(i), int(j), int(k)), int(t["degC"]), str(t["effect"]))
                        for t in s["terms"]
                        for i, j, k in [t["powers"]]
                    ),
                )
                for s in given["sensors"]
            )
            degC = given["degC_range"]
            reference, df = given["reference_degC"], given.get("covariance_df")
            return AttitudeCalibration(
                sensors=sensors,
                covariance=np.array(given["covariance"], np.float64),
                pitch_range_deg=_pair(given["pitch_range_deg"]),
                roll_range_deg=_pair(given["roll_range_deg"]),
                roll=bool(given["roll"]),
                degC_range=None if degC is None else _pair(degC),
                reference_degC=None if reference is None else float(reference),
                notes=tuple(str(note) for note in given["notes"]),
                covariance_df=None if df is None else float(df),
            )
        except (KeyError, TypeError) as problem:
            raise ValueError(f"a calibration of attitude lacks or garbles {problem}") from problem


def with_roll(rows: FloatArray) -> FloatArray:
    """(4, ...) coefficients or rows of their root, from (3, ...) of the model without roll put in their places."""
    return np.insert(rows, 2, 0.0, axis=0) if len(rows) == len(COLUMNS) - 1 else rows


def _axis(fit: AttitudeFit) -> str:
    return fit.model[-1] if fit.has_roll else "xyz"[int(np.argmax(np.abs(fit.sensitive_axis)))]


def _common(ranges: Sequence[Range]) -> Range:
    """What all of them have in common."""
    return max(low for low, _ in ranges), min(high for _, high in ranges)


def _pair(values: Sequence[float]) -> Range:
    low, high = values
    return float(low), float(high)
