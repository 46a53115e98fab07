"""Budgets of attitude sensors: parameters, outputs and inferred angles as functions of the recorded columns.

The sensitivity is in volts per local g, since the head's angles relate to local gravity; with local gravity in the
register it is given per standard gravity (9.80665 m/s2) as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.errors import FitError
from rig.fitter.linear import orthonormal
from rig.fitter.strata import by_side, reversed_by, sides_of
from rig.fitter.sums_of_squares import FTest, project_out
from rig.procedures.attitude.data import AttitudeData, settings
from rig.procedures.attitude.fit import AttitudeFit, fit_all
from rig.procedures.attitude.infer import AttitudeCalibration
from rig.procedures.attitude.infer.calibrate import calibrate_package, told_of_drift
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.results import PITCH, ROLL, Model
from rig.procedures.attitude.temperature import Temperature
from rig.procedures.evaluate.budgeting import SCATTER, Evaluation, Results, Shift, Shifts, no_error
from rig.procedures.evaluate.reversibility import in_words, line_of
from rig.procedures.evaluate.scatter_for_budgets import Scatter, scatter
from rig.procedures.tables.table import SENSOR_TEMPERATURE, Columns

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray, IntArray
    from rig.procedures.attitude.infer.traced import Volts
    from rig.procedures.evaluate.stated import PlaceConstant

_STEP = 1e-6
LOOP = "rising and falling series"
"""Effect of the run under which a calibration has the loops of its sensors."""


class AttitudeEvaluation(Evaluation):
    """The declared model, fitted to every sensor of a run."""

    def __init__(
        self, data: AttitudeData, at_deg: Sequence[tuple[float, float]], *, temperature: bool, gravity: float | None
    ) -> None:
        self._data, self._temperature, self._gravity = data, temperature, gravity
        self._at = np.array(at_deg, np.float64).reshape(-1, 2)
        self._plain = calibrate_package(data, temperature=temperature)
        self._expected: Mapping[str, float] = {}

    def explain(self, expected: Mapping[str, float]) -> None:
        """Say before anything else what sum of squares stated errors leave in the residuals, by sensor."""
        if "_model" in vars(self):
            raise ValueError("errors are to be explained before anything is evaluated")
        self._expected = expected

    @cached_property
    def _model(self) -> Model:
        return Model(self._with_scatter(self._beside_loops, self._scatter), self._at, self._gravity)

    @property
    def calibration(self) -> AttitudeCalibration:
        """Calibration of the run, with the scatter that its budget has."""
        return self._model.calibration

    @cached_property
    def _beside_loops(self) -> AttitudeCalibration:
        """The calibration with the scatter of readings of one direction: loops have lines of their own."""
        return self._beside({LOOP: self._loops}) if self._loops else self._plain

    def _beside(self, loops: Volts) -> AttitudeCalibration:
        """The calibration with further effects of the run, fitted and not applied in use."""
        return calibrate_package(self._data, effects=loops, temperature=self._temperature, left_behind=loops)

    @cached_property
    def _plain_fits(self) -> Mapping[str, AttitudeFit]:
        return fit_all(self._data, temperature=self._temperature)

    @cached_property
    def _fits(self) -> Mapping[str, AttitudeFit]:
        """Fits of the readings without loops."""
        if not self._loops:
            return self._plain_fits
        off = {name: self._data.outputs[name] - volts.sum(axis=1) for name, volts in self._loops.items()}
        return fit_all(replace(self._data, outputs={**self._data.outputs, **off}), temperature=self._temperature)

    @cached_property
    def columns(self) -> Columns:
        """The recorded columns that it uses, corrected."""
        d = self._data
        warm = {SENSOR_TEMPERATURE: d.sensor_temperature_degC} if d.sensor_temperature_degC is not None else {}
        warm = warm if self._temperature else {}
        return {PITCH: d.pitch_deg, ROLL: d.roll_deg, **warm, **d.outputs}

    @cached_property
    def settings(self) -> Mapping[str, IntArray]:
        """(n,) number of the setting of each observation, from 0, by the column of a factor; "" for points of all."""
        d = self._data
        return {PITCH: settings(d.pitch_deg), ROLL: settings(d.roll_deg), "": d.point}

    @property
    def replication(self) -> IntArray:
        """(n,) number of the replication of each observation, from 0."""
        return self._data.replicate_index

    def _coefficients(self, moved: Mapping[str, FloatArray]) -> FloatArray:
        """(S, 4) coefficients of the declared model with additions to columns."""
        own = self._solved(moved)[0]
        return np.insert(own, 2, 0.0, axis=1) if own.shape[1] == 3 else own

    def _solved(self, moved: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """(S, k) coefficients of the declared model and (S, n) residuals, with additions to columns."""

        def column(name: str) -> FloatArray:
            added = moved.get(name)
            return self.columns[name] if added is None else self.columns[name] + added

        d = self._data
        h = attitude_columns(column(PITCH), column(ROLL), roll=d.has_roll)
        y = np.column_stack([column(name) for name in d.outputs])
        if not self._temperature:
            own = _solve(h, y)
            return own.T, (y - h @ own).T
        warmth, found, left = column(SENSOR_TEMPERATURE) - self._reference, [], []
        for j, name in enumerate(d.outputs):
            every = self._with_warmth(h, warmth, name)
            solved = _solve(every, y[:, j])
            found.append(solved[: h.shape[1]])
            left.append(y[:, j] - every @ solved)
        return np.array(found), np.array(left)

    def _with_warmth(self, h: FloatArray, warmth: FloatArray, name: str) -> FloatArray:
        """(n, k + 2) columns of a sensor whose offset and sensitivity depend on its temperature."""
        return np.column_stack([h, warmth, warmth * (h[:, 1:] @ self._own[name])])

    @property
    def _reference(self) -> float:
        reference = self._plain.reference_degC
        assert reference is not None
        return reference

    @cached_property
    def _own(self) -> Mapping[str, FloatArray]:
        """Direction of each sensor's temperature term."""
        found = {name: fit.temperature for name, fit in self._plain_fits.items()}
        return {name: one.direction for name, one in found.items() if isinstance(one, Temperature)}

    @cached_property
    def _base(self) -> FloatArray:
        return self._coefficients({})

    def coefficients(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(k,) coefficients of the calibration by sensor, with additions to columns."""
        mine = {name: moved for name, moved in columns.items() if name in self.columns}
        found = self._coefficients(mine) if mine else self._base
        return dict(zip(self._plain.names, found, strict=True))

    def residuals(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(n,) residuals of the fit by sensor, with additions to columns; none where scatter needs no repeats."""
        mine = {name: moved for name, moved in columns.items() if name in self.columns}
        return dict(zip(self._plain.names, self._solved(mine)[1], strict=True))

    def evaluate(self, shift: Shift) -> FloatArray:
        """(m,) values of the results with changed inputs."""
        columns = {name: moved for name, moved in shift.columns.items() if name in self.columns}
        coefficients = self._coefficients(columns) if columns else self._base
        readings = self._model.readings
        if shift.in_use is not no_error:
            names = self._model.calibration.names
            added = [shift.in_use(name, readings[:, j]) for j, name in enumerate(names)]
            readings = readings + np.column_stack(added)
        gravity = shift.constants.get("gravity", self._model.gravity)
        return self._model.values(coefficients, readings, gravity)

    @cached_property
    def results(self) -> Results:
        """Results of the columns as they are."""
        model = self._model
        named = list(model.named())
        values = model.values(self._base, model.readings, model.gravity)
        known = np.isfinite(values)
        if not known.all():
            lost = next(name for (name, *_), one in zip(named, known, strict=True) if not one)
            raise FitError(f"{lost}: these sensors do not determine it there; choose another point with --at")
        names, units, sensors, at = zip(*named, strict=True)
        type_a, of_fit = self._type_a(len(values))
        return Results(names, units, values, type_a, sensors, of_fit, at)

    @cached_property
    def _scatter(self) -> Mapping[str, Scatter]:
        """Scatter of the readings of every sensor."""
        return self._scatters(self._beside_loops, self._fits)

    def _scatters(self, calibration: AttitudeCalibration, fits: Mapping[str, AttitudeFit]) -> Mapping[str, Scatter]:
        found = {}
        for one in calibration.sensors:
            table = fits[one.name].replication
            below, total = float(table.bias.df_below), one.sigma_V**2 * one.df
            pure = table.sigma_prec**2 * one.df if below > 0 and np.isfinite(table.sigma_prec) else 0.0
            found[one.name] = scatter(total, float(one.df), pure, below, self._expected.get(one.name, 0.0))
        return found

    def _with_scatter(self, calibration: AttitudeCalibration, scatters: Mapping[str, Scatter]) -> AttitudeCalibration:
        """The calibration with the scatter that budgets have."""
        every = scatters.values()
        if calibration.drift is not None or not any(one.explained for one in every):
            return calibration
        sensors, ratios = [], []
        for sensor, one in zip(calibration.sensors, every, strict=True):
            ratios += [one.variance**0.5 / sensor.sigma_V] * sensor.coefficients.size
            sensors.append(replace(sensor, sigma_V=one.variance**0.5, df=one.df))
        covariance = calibration.covariance * np.outer(ratios, ratios)
        return replace(calibration, sensors=tuple(sensors), covariance=covariance)

    def described(self, sensor: str) -> str:
        """How a sensor's output follows from its coefficients, a sentence; "" if it is not said."""
        across = " - my cos(pitch) sin(roll) - mz cos(pitch) cos(roll)" if self._data.has_roll else " - mz cos(pitch)"
        warm = self._plain.reference_degC
        at = f", at a sensor temperature of {warm:.1f} degC" if self._temperature and warm is not None else ""
        return (
            f"Output in V: offset + mx sin(pitch){across}{at}; the sensitivity is the length of the vector m, which is "
            f"along the sensitive axis, in V per local g"
        )

    def charted(self, sensor: str) -> tuple[str, FloatArray]:
        """Unit of a sensor's errors in its control chart, and (p,) its output at the points per such a unit. An angle
        is an output over the sensitivity, in degrees.
        """
        m = self._base[self._plain.names.index(sensor), 1:]
        return "deg", np.full(len(self._at), np.radians(np.linalg.norm(m)))

    def stored(self) -> Any:
        """The calibration to use with these results, as JSON values, if it is not that of the fit; None if it is."""
        # lines of loops are not kept, so that its scatter is of both directions
        return self._with_scatter(self._plain, self._scatters(self._plain, self._plain_fits)).to_dict()

    @cached_property
    def _jacobian(self) -> FloatArray:
        """(m, 4 S) derivative of the results by the coefficients of all sensors."""
        model, columns = self._model, []
        step = _STEP * float(np.max(np.abs(self._base)))
        for i in range(self._base.size):
            moved = np.zeros(self._base.size)
            moved[i] = step
            each = (self._base + sign * moved.reshape(self._base.shape) for sign in (1, -1))
            up, down = (model.values(one, model.readings, model.gravity) for one in each)
            columns.append((up - down) / (2 * step))
        return np.column_stack(columns)

    @property
    def _sides(self) -> Sequence[tuple[str, FTest, FloatArray | None]]:
        """Sensor and axis, test of rising against falling angles, and (2, 4 S) coefficients of rising and of falling
        angles less those of the fit, if they differ.
        """
        return self._of_sides[0]

    @property
    def _loops(self) -> Mapping[str, FloatArray]:
        """(n, q) parts of the readings by which rising and falling angles differ, V, by sensor that has any."""
        return self._of_sides[1]

    @cached_property
    def _of_sides(self) -> tuple[list[tuple[str, FTest, FloatArray | None]], dict[str, FloatArray]]:
        d, found, loops = self._data, [], {}
        sides = [(axis, np.asarray(one, np.float64)) for axis, one in (("pitch", d.pitch_side), ("roll", d.roll_side))]
        tests = len(d.sensors) * sum(len(np.unique(side[side != 0.0])) > 1 for _, side in sides)
        h = attitude_columns(d.pitch_deg, d.roll_deg, roll=d.has_roll)
        for i, (name, left) in enumerate(self.residuals({}).items()):
            every = h
            if self._temperature:
                every = self._with_warmth(h, self.columns[SENSOR_TEMPERATURE] - self._reference, name)
            basis = orthonormal(every)
            rest, seen = project_out(left, basis), np.zeros((len(left), 0))
            for axis, side in sides:
                differs, test, _, wider = by_side(h, basis, rest, side, tests)
                seen = np.column_stack([seen, wider[:, basis.shape[1] :]])
                if (held := self._by_side(name, axis)) is not None:
                    more = sides_of(reversed_by(h, held, side, basis))
                    differs = more if differs is None else differs + more
                if differs is not None:
                    differs = np.insert(differs, 2, 0.0, axis=1) if differs.shape[1] == 3 else differs
                    differs = np.pad(differs, ((0, 0), (4 * i, self._base.size - 4 * i - 4)))
                found.append((f"{name} in {axis}", test, differs))
            if seen.shape[1]:
                seen = orthonormal(seen)
                loops[name] = seen * (seen.T @ rest)
        return found, loops

    def _by_side(self, name: str, axis: str) -> FloatArray | None:
        """(n,) the part of a sensor's readings taken off that is of the direction of an axis, V; None without any."""
        return None

    def reversibility(self) -> Iterable[TypeA]:
        """Differences between rising and falling series, as covariances of the results, which are half-way between. For
        each sensor and axis.
        """
        for name, _, differs in self._sides:
            if differs is not None:
                yield line_of(name, differs @ self._jacobian.T, self.results.of_fit)

    def _type_a(self, size: int) -> tuple[TypeA, FloatArray]:
        """Scatter of the run through the fit; of inferred angles as in use, with one reading. (m,) variances by the
        fit alone.
        """
        calibration, model = self._model.calibration, self._model
        sizes = [one.coefficients.size for one in calibration.sensors]
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        rows = np.concatenate([np.arange(start, start + 4) for start in starts])
        drift, last = calibration.drift, len(model.at_deg) * len(model.angles)
        if drift is None:
            covariance = calibration.covariance[np.ix_(rows, rows)]
            df = {one.name: float(one.df) for one in calibration.sensors}
        else:  # a use deviates from the mean of n replications as they do from one another: n + 1 times its error
            covariance, df = (
                drift.covariance[np.ix_(rows, rows)] / (drift.df + 2),
                dict.fromkeys(calibration.names, float(drift.df)),
            )
        found = self._jacobian @ covariance @ self._jacobian.T
        of_fit = np.diag(found).copy()
        every = np.array([df.get(sensor, np.inf) for _, _, sensor, _ in model.named()])
        answer = model.infer(calibration, model.readings)
        sd = np.column_stack([answer.pitch_sd_deg, answer.roll_sd_deg])[:, : len(model.angles)].ravel()
        inferred = np.arange(size - last, size)
        found[inferred, inferred] = sd**2
        every[inferred] = np.column_stack([answer.df, answer.roll_df])[:, : len(model.angles)].ravel()
        return TypeA(found, every, *SCATTER), of_fit

    def of_place(self, constant: PlaceConstant) -> Iterable[tuple[str, Shifts]]:
        """Levelling as two tilts of the head's base; local gravity as the scale of the sensitivity."""
        if constant.name == "gravity" and self._gravity is not None:
            g, u = self._gravity, constant.standard
            yield "", lambda times: Shift(constants={"gravity": g + times * u})
        if constant.name == "levelling":
            pitch, roll = self.columns[PITCH], self.columns[ROLL]
            yield " about the pitch axis", lambda times: Shift({PITCH: np.full_like(pitch, times * constant.standard)})
            if self._data.has_roll:
                yield (
                    " along the pitch axis",
                    lambda times: Shift(levelled(pitch, roll, times * constant.standard)),
                )

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        drift = told_of_drift({one.name: self._fits[one.name].replication for one in self._plain.sensors})
        yield from (words for words in (drift, *(one.sentence(name) for name, one in self._scatter.items())) if words)
        yield from (in_words(name, test) for name, test, differs in self._sides if differs is not None)


def _solve(h: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(h, y, rcond=None)[0], np.float64)


def levelled(pitch_deg: FloatArray, roll_deg: FloatArray, tilt_deg: float) -> Mapping[str, FloatArray]:
    """Additions to pitch and roll for a base that is tilted about the roll axis's direction at zero pitch.

    Gravity in the base is (0, -sin t, -cos t). The head turns it by pitch, then by roll; the angles of a level head
    with the same gravity in the package are exact, also where pitch passes 90 deg.

    Args:
        pitch_deg: (n,) angles of the head.
        roll_deg: (n,).
        tilt_deg: tilt t of the base along the pitch axis, about the horizontal axis across it.
    """
    a, t = np.radians(pitch_deg), np.radians(tilt_deg)
    x, z = np.sin(a) * np.cos(t), np.cos(a) * np.cos(t)
    side = np.where(z < 0, -1.0, 1.0)
    pitch = np.arctan2(x, side * np.hypot(np.sin(t), z))
    roll = np.arctan2(np.sin(t) * side, z * side)
    turned = np.degrees(pitch) - pitch_deg
    return {"pitch_deg": turned - 360.0 * np.round(turned / 360.0), "roll_deg": np.degrees(roll)}
