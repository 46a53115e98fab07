"""All data for inferring attitude from a package's outputs: models, joint covariance, noise, range of validity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.fit import AttitudeFit
from rig.procedures.attitude.infer.misfit import Misfit
from rig.procedures.attitude.infer.sensor_model import SensorModel, Term
from rig.procedures.attitude.model import (
    AXES,
    COLUMNS,
    AttitudeParameters,
    NoRollParameters,
    attitude_parameters,
    no_roll_parameters,
)
from rig.procedures.tables.within import Within

Range = tuple[float, float]
KIND = "attitude"

_ROUNDING = 1e-14
_GRAVITY_COLUMNS = np.array([1.0, 1.0, -1.0, -1.0])
"""Columns of a sensor's model over one and gravity in package axes."""


@dataclass(frozen=True, eq=False)
class Drift:
    """Variation in use if the parameters differ significantly between replications.

    Attributes:
        covariance: (K, K) of the coefficients in use about those of the calibration, V^2.
        df: its degrees of freedom, number of replications minus one.
        sigma_V: (S,) scatter about each replication's own fit.
        sigma_df: (S,) its degrees of freedom.
    """

    covariance: FloatArray
    df: float
    sigma_V: FloatArray
    sigma_df: FloatArray

    def __post_init__(self) -> None:
        for name in ("covariance", "sigma_V", "sigma_df"):
            value = np.array(getattr(self, name), np.float64)
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if not (self.df > 0 and np.all(self.sigma_df > 0) and np.all(self.sigma_V > 0)):
            raise FitError("drift between replications needs positive sigmas and degrees of freedom")

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "covariance": self.covariance.tolist(),
            "df": self.df,
            "sigma_V": self.sigma_V.tolist(),
            "sigma_df": self.sigma_df.tolist(),
        }


@dataclass(frozen=True, eq=False)
class AttitudeCalibration:
    """Calibration of a package.

    Attributes:
        sensors: S sensors, in the order of the outputs.
        covariance: (K, K) joint covariance of all coefficients, sensor by sensor, V^2.
        pitch_range_deg: lowest and highest pitch calibrated.
        roll_range_deg: the same for roll.
        roll: whether the package was calibrated with roll; without it, zero roll is assumed.
        degC_range: the same for the sensors' temperature; None if it was not recorded.
        reference_degC: temperature at which temperature terms are zero.
        notes: notes for readers: omitted effects, with reasons.
        drift: variation in use if the parameters drift between replications; otherwise None.
        alternatives: the same calibration with another member of a class of inseparable causes in place of the named
            one: (named, member, calibration). Intervals in use cover all of them.
        misfits: by sensor, the remaining lack of fit with the effects; empty for a calibration from another source.
    """

    sensors: tuple[SensorModel, ...]
    covariance: FloatArray
    pitch_range_deg: Range
    roll_range_deg: Range
    roll: bool = True
    degC_range: Range | None = None
    reference_degC: float | None = None
    notes: tuple[str, ...] = field(default=())
    drift: Drift | None = None
    alternatives: tuple[tuple[str, str, AttitudeCalibration], ...] = ()
    misfits: Mapping[str, Misfit] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.sensors:
            raise FitError("a calibration without sensors gives no attitude")
        if len(set(self.names)) != len(self.sensors):
            raise FitError(f"two sensors have the same name: {', '.join(self.names)}")
        size = sum(s.coefficients.size for s in self.sensors)
        object.__setattr__(self, "covariance", _checked(self.covariance, size))
        if self.drift is not None:
            _checked(self.drift.covariance, size)
            if not self.drift.sigma_V.shape == self.drift.sigma_df.shape == (len(self.sensors),):
                raise FitError(f"drift between replications: expected {len(self.sensors)} sigmas")
        if any(s.needs_temperature for s in self.sensors) and self.reference_degC is None:
            raise FitError("a calibration with temperature terms needs the temperature at which they are zero")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(s.name for s in self.sensors)

    @cached_property
    def needs_temperature(self) -> bool:
        """Whether inference needs the sensors' temperature."""
        return any(s.needs_temperature for s in self.sensors)

    @property
    def offsets_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(S,)."""
        return np.array([s.coefficients[0] for s in self.sensors])

    @cached_property
    def matrix(self) -> FloatArray:
        """(S, 3) sensitive axes times sensitivities, V/g: outputs minus offsets = matrix @ g_M."""
        return np.array([s.sensitive_axis for s in self.sensors])

    @cached_property
    def sigma_V(self) -> FloatArray:  # noqa: N802 - the unit is part of the name
        """(S,) standard deviation of one reading."""
        return np.array([s.sigma_V for s in self.sensors]) if self.drift is None else self.drift.sigma_V

    @cached_property
    def sigma_df(self) -> FloatArray:
        """(S,) its degrees of freedom."""
        return np.array([s.df for s in self.sensors]) if self.drift is None else self.drift.sigma_df

    @property
    def use_covariance(self) -> FloatArray:
        """(K, K) covariance of the coefficients in use."""
        return self.covariance if self.drift is None else self.drift.covariance

    @cached_property
    def root(self) -> FloatArray:
        """(K, K) with root @ root.T = `use_covariance`; it exists also without full rank."""
        return _root(self.use_covariance)

    @cached_property
    def alike(self) -> tuple[FloatArray, FloatArray] | None:
        """Roots (S, S) and (4, 4) of the factors of `use_covariance`, of the sensors and of each one's columns one and
        gravity, if it is their Kronecker product within the rounding: all sensors were calibrated at the same points.
        None otherwise, and if they have further terms.
        """
        whole = self.use_covariance
        scale = np.sqrt(np.diag(whole))
        if any(s.terms for s in self.sensors) or not scale[:4].any():
            return None
        parts = whole.reshape(len(self.sensors), 4, len(self.sensors), 4)
        own, largest = parts[0, :, 0], np.argmax(np.diag(parts[0, :, 0]))
        between = parts[:, largest, :, largest] / own[largest, largest]
        if np.any(np.abs(np.kron(between, own) - whole) > _ROUNDING * np.outer(scale, scale)):
            return None
        return _root(between), _GRAVITY_COLUMNS[:, None] * _root(own)

    @cached_property
    def products(self) -> FloatArray:
        """(S (S + 1) / 2, 10) factors of products of two of one and the components of gravity, each pair once, in the
        covariance of the parts of each pair of sensors without further terms (`use_covariance`).
        """
        parts = self.use_covariance.reshape(len(self.sensors), 4, len(self.sensors), 4)
        s, t = np.triu_indices(len(self.sensors))
        i, j = np.triu_indices(4)
        every = parts[s, :, t]
        found = every[:, i, j] + np.where(i == j, 0.0, every[:, j, i])
        found *= np.sign(i - 1.5) * np.sign(j - 1.5)  # columns: 1, gx, -gy, -gz
        return np.asarray(found * np.where(s == t, 1.0, 2.0)[:, None])

    def for_readings(self, within: Mapping[str, Within], count: float) -> AttitudeCalibration:
        """This calibration for readings in use that are means of `count` readings, by their scatter inside points."""
        sigma, df = np.empty(len(self.sensors)), np.empty(len(self.sensors))
        for i, name in enumerate(self.names):
            variance, own = float(self.sigma_V[i] ** 2), within[name]
            change = own.change(variance, count)
            sigma[i] = np.sqrt(variance + change)
            df[i] = (variance + change) ** 2 / (variance**2 / self.sigma_df[i] + change**2 / max(own.df, 1.0))
        pairs = zip(self.sensors, sigma.tolist(), df.tolist(), strict=True)
        sensors = tuple(replace(one, sigma_V=s, df=n) for one, s, n in pairs)
        drift = self.drift and replace(self.drift, sigma_V=sigma, sigma_df=df)
        others = tuple((named, member, one.for_readings(within, count)) for named, member, one in self.alternatives)
        return replace(self, sensors=sensors, drift=drift, alternatives=others)

    def parameters(self, name: str) -> tuple[AttitudeParameters | NoRollParameters, float]:
        """The paper's parameters of a stored sensor, with further terms, and their degrees of freedom.

        Raises:
            FitError: there is no such sensor.
        """
        one = self.only([name])
        sensor, drift, keep = one.sensors[0], one.drift, range(len(COLUMNS)) if self.roll else (0, 1, 3)
        # a use deviates from the mean of n replications as they do from one another: n + 1 times its error
        covariance, df = (one.covariance, sensor.df) if drift is None else (drift.covariance / (drift.df + 2), drift.df)
        own, block = sensor.coefficients[list(keep)], covariance[np.ix_(keep, keep)]
        if not self.roll:
            return no_roll_parameters(own, block), df
        return attitude_parameters(AXES[sensor.axis], own, block), df

    def only(self, names: Sequence[str]) -> AttitudeCalibration:
        """The calibration of some of the sensors, in the order given.

        Raises:
            FitError: there is no such sensor.

        """
        unknown = [name for name in names if name not in self.names]
        if unknown:
            raise FitError(f"the calibration has no sensor {unknown[0]}, only {', '.join(self.names)}")
        sizes = [s.coefficients.size for s in self.sensors]
        starts = np.concatenate([[0], np.cumsum(sizes)])
        picked = [self.names.index(name) for name in names]
        rows = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in picked])
        block = np.ix_(rows, rows)
        drift = self.drift and replace(
            self.drift,
            covariance=self.drift.covariance[block],
            sigma_V=self.drift.sigma_V[picked],
            sigma_df=self.drift.sigma_df[picked],
        )
        sensors = tuple(self.sensors[i] for i in picked)
        others = tuple((named, member, other.only(names)) for named, member, other in self.alternatives)
        misfits = {name: one for name, one in self.misfits.items() if name in names}
        return replace(
            self, sensors=sensors, covariance=self.covariance[block], drift=drift, alternatives=others, misfits=misfits
        )

    @classmethod
    def from_fits(cls, fits: Sequence[AttitudeFit]) -> AttitudeCalibration:
        """The calibration of a package whose sensors were calibrated one by one: their errors are independent.

        Args:
            fits: one per sensor, all with roll or all without.

        Raises:
            FitError: there is none, or sensors with and without roll are mixed.
        """
        if not fits:
            raise FitError("a calibration without sensors gives no attitude")
        if len({f.has_roll for f in fits}) > 1:
            raise FitError("some of the sensors were calibrated with roll, others without: calibrate them alike")
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
        """JSON values; `from_dict` restores the same object."""
        return {
            "kind": KIND,
            "roll": self.roll,
            "sensors": [s.to_dict() for s in self.sensors],
            "covariance": self.covariance.tolist(),
            "drift": None if self.drift is None else self.drift.to_dict(),
            "pitch_range_deg": list(self.pitch_range_deg),
            "roll_range_deg": list(self.roll_range_deg),
            "degC_range": None if self.degC_range is None else list(self.degC_range),
            "reference_degC": self.reference_degC,
            "notes": list(self.notes),
            "lack_of_fit": {
                name: one.to_dict() | {"sentence": one.sentence(name)} for name, one in self.misfits.items()
            },
            "alternatives": [
                {"named": named, "member": member, "calibration": other.to_dict()}
                for named, member, other in self.alternatives
            ],
        }

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> AttitudeCalibration:
        """Restore a calibration from `to_dict`.

        Raises:
            FitError: it is not such a calibration; the message names the defect.
        """
        if given.get("kind") != KIND:
            raise FitError(f"this is not a calibration of attitude, its kind is {given.get('kind')!r}")
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
            reference, drift = given["reference_degC"], given.get("drift")
            return AttitudeCalibration(
                sensors=sensors,
                covariance=np.array(given["covariance"], np.float64),
                pitch_range_deg=_pair(given["pitch_range_deg"]),
                roll_range_deg=_pair(given["roll_range_deg"]),
                roll=bool(given["roll"]),
                degC_range=None if degC is None else _pair(degC),
                reference_degC=None if reference is None else float(reference),
                notes=tuple(str(note) for note in given["notes"]),
                misfits={str(name): Misfit.from_dict(one) for name, one in given.get("lack_of_fit", {}).items()},
                drift=None
                if drift is None
                else Drift(
                    np.array(drift["covariance"], np.float64),
                    float(drift["df"]),
                    np.array(drift["sigma_V"], np.float64),
                    np.array(drift["sigma_df"], np.float64),
                ),
                alternatives=tuple(
                    (str(one["named"]), str(one["member"]), AttitudeCalibration.from_dict(one["calibration"]))
                    for one in given.get("alternatives", ())
                ),
            )
        except (KeyError, TypeError) as problem:
            raise FitError(f"a calibration of attitude lacks or garbles {problem}") from problem


def _root(covariance: FloatArray) -> FloatArray:
    """(K, K) with root @ root.T = (K, K) `covariance`, which need not have full rank."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _checked(given: FloatArray, size: int) -> FloatArray:
    covariance = np.array(given, np.float64)
    if covariance.shape != (size, size):
        raise FitError(f"expected a covariance of {size} by {size}, found shape {covariance.shape}")
    if not np.all(np.isfinite(covariance)):
        raise FitError("the covariance has entries that are no numbers")
    values = np.linalg.eigvalsh((covariance + covariance.T) / 2)
    scale = np.abs(covariance).max(initial=0.0)
    if np.abs(covariance - covariance.T).max() > 1e-9 * scale or values[0] < -1e-9 * scale:
        raise FitError("the matrix is not a covariance: it is not symmetric and positive")
    covariance.flags.writeable = False
    return covariance


def with_roll(rows: FloatArray) -> FloatArray:
    """(4, ...) coefficients or rows of their root, from (3, ...) of the model without roll."""
    return np.insert(rows, 2, 0.0, axis=0) if len(rows) == len(COLUMNS) - 1 else rows


def _axis(fit: AttitudeFit) -> str:
    return fit.model[-1] if fit.has_roll else "xyz"[int(np.argmax(np.abs(fit.sensitive_axis)))]


def _common(ranges: Sequence[Range]) -> Range:
    """The common value of all of them."""
    return max(low for low, _ in ranges), min(high for _, high in ranges)


def _pair(values: Sequence[float]) -> Range:
    low, high = (float(value) for value in values)
    if not low <= high:
        raise FitError(f"a range from {low:g} to {high:g} is none")
    return low, high
