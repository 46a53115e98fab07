"""The calibration of a package from one run, with the effects found by a trace and, if requested, temperature.

Effects of the package (sag, sensor nonlinearity, temperature) exist in use as well and are part of inference. Effects
of the head or the run (backlash, the head's scale, drift, steps) are fitted, so that they do not bias the coefficients,
and then omitted, with a note.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.fitter import LinearFit, RankError, least_squares
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.misfit import lacks_fit, reach_beside
from rig.fitter.own_span import AT_ONCE
from rig.fitter.replication import Replication, analyse, replication_spread
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fit import drifting, drifting_together, moved_by
from rig.procedures.attitude.infer.calibration import AttitudeCalibration, Drift, with_roll
from rig.procedures.attitude.infer.misfit import Misfit
from rig.procedures.attitude.infer.sensor_model import SensorModel, Term
from rig.procedures.attitude.model import (
    AXES,
    COLUMNS,
    attitude_parameters,
    fit_columns,
    no_roll_parameters,
    nominal_axis,
    sensitive_axis,
    sigma_deg,
)
from rig.procedures.attitude.temperature import Temperature

OFFSET, SENSITIVITY = "offset-temperature", "sensitivity-temperature"
_SECOND = tuple((i, j, k) for k in (0, 1) for j in range(3) for i in range(3) if i + j + k <= 2)
_THIRD = tuple((i, j, k) for k in (0, 1) for j in range(4) for i in range(4) if i + j + k <= 3)
_FIRST = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
# no power of g_z above one: the squares sum to one, so these are all polynomials on the sphere, each once
_BASES = (
    tuple((powers, 0) for powers in _SECOND),
    tuple((powers, 0) for powers in _THIRD),
    tuple((powers, 1) for powers in _FIRST),
    tuple((powers, 1) for powers in _SECOND),
)
_EXACT = 1e-7


def _of_the_run() -> set[str]:
    """Effects of the head or the run, which do not exist in use."""
    from rig.procedures.attitude.effects import CATALOGUE  # noqa: PLC0415 - only effects of a trace need it

    return {effect.name for effect in CATALOGUE if effect.source not in ("package", "sensor", "temperature")}


class NotApplicable(FitError):
    """An effect of the package that is not a function of gravity and temperature, so that it cannot be
    applied in use.
    """

    def __init__(self, effect: str) -> None:
        """Store the effect's name."""
        super().__init__(f"{effect} is no function of gravity in the package and its temperature: it cannot be applied")
        self.effect = effect


def calibrate_package(
    data: AttitudeData,
    sensors: Sequence[str] | None = None,
    *,
    effects: Mapping[str, Mapping[str, FloatArray]] | None = None,
    temperature: bool = False,
    left_behind: Collection[str] = (),
    merge: bool = False,
) -> AttitudeCalibration:
    """Fit the sensors of one run, with the correlation of their coefficients: head errors are common to all of them.

    Args:
        data: the run.
        sensors: names of the outputs to use, in the order of use; None for all.
        effects: by name and sensor, (n,) contribution to the observations, volts, or (n, q) those of its terms, as in
            `FoundEffect.columns_V`. Its size is fitted again with the model, so that its uncertainty is in the
            covariance; likewise each term's, if given.
        temperature: fit offset and sensitivity as linear in the sensor temperature (section 9, row 28(b) of Table 2).
        left_behind: effects that are fitted but not applied in use, in addition to those of head and run.
        merge: let the others take up an effect that one sensor's points cannot tell from them, with a note. Several
            sensors together may tell the square of a voltmeter from that of a sensor; one alone does not.

    Raises:
        KeyError: there is no such output.
        rig.fitter.linear.RankError: the points do not determine the model with its effects.
        NotApplicable: an effect of the package cannot be computed for other attitudes.
        FitError: no sensor temperature was recorded or it never changed, or an effect has another number of
            observations.
    """
    chosen = data.sensors if sensors is None else tuple(sensors)
    degC = data.sensor_temperature_degC
    reference = None if degC is None else float(np.mean(degC))
    warmth = np.zeros(len(data)) if degC is None else degC - np.mean(degC)
    base, g = data.rows.columns, np.empty((3, 0))
    if effects or temperature:  # of a million rows it is a tenth of the memory
        g = data.g_M.T if data.has_roll else np.stack([base[:, 1], np.zeros(len(data)), -base[:, 2]])
    models, maps, fits, fitted, residuals = [], [], [], [], []
    tables, spreads = [], []
    left: set[str] = set()
    misfits: dict[str, Misfit] = {}
    merged: list[str] = []
    for name in chosen:
        y = data.outputs[name]
        plain = fit_columns(base, y)
        shapes = {e: _columns(by[name]) for e, by in (effects or {}).items() if name in by}
        if temperature:
            own = Temperature.of(data, base, y, plain).columns(base, data)
            shapes |= {OFFSET: own[:, :1], SENSITIVITY: own[:, 1:]}
        shapes = {e: v for e, v in shapes.items() if np.any(v)}
        wrong = [e for e, v in shapes.items() if len(v) != len(data)]
        if wrong:
            raise ValueError(f"{wrong[0]} of {name}: expected {len(data)} observations, found {shapes[wrong[0]].shape}")
        if merge:
            shapes = _told_apart(base, y, shapes, name, merged)
        fit, columns, owners = _beside(base, plain.names, y, shapes)
        behind = (_of_the_run() | set(left_behind)) & set(shapes) if shapes else set()
        left |= behind
        own_columns = list(zip(owners, columns[:, base.shape[1] :].T, strict=True))
        terms, to_model = _model_of(own_columns, behind, g, warmth, base.shape[1])
        letter = _axis_letter(name, data, fit, base.shape[1])
        models.append(SensorModel(name, letter, to_model @ fit.coefficients, fit.sigma, fit.df, terms))
        maps.append(to_model)
        fits.append(fit)
        fitted.append(columns)
        residuals.append(y - fit.predict(columns))
        alone, extra = fit.first(base.shape[1]), columns[:, base.shape[1] :]
        corrected = residuals[-1] + alone.predict(base)
        tables.append(analyse(alone, data.rows.beside(extra), corrected, extra.shape[1]))
        misfits[name] = _misfit(alone, tables[-1], letter if data.has_roll else None)
        spreads.append(replication_spread(base, corrected, data.replicate_index, alone))
    notes = [f"fitted beside the model and not applied in use: {', '.join(sorted(left))}"] if left else []
    if merged:
        notes.append(f"taken up by the rest of the model, from which one sensor does not tell it: {', '.join(merged)}")
    lacking = [one.sentence(name) for name, one in misfits.items() if one.model_error is not None]
    if lacking:
        notes.append(
            f"{'; '.join(lacking)}; model error, which repeats in every replication, is not in standard deviations, "
            "nor in the intervals of angles"
        )
    covariance = _joint(fits, maps, fitted, np.array(residuals))
    drift, told = _drift(chosen, tables, covariance, spreads, models)
    notes += [told] if told else []
    return AttitudeCalibration(
        sensors=tuple(models),
        covariance=covariance,
        drift=drift,
        pitch_range_deg=(float(data.pitch_deg.min()), float(data.pitch_deg.max())),
        roll_range_deg=(float(data.roll_deg.min()), float(data.roll_deg.max())),
        roll=data.has_roll,
        degC_range=None if degC is None else (float(degC.min()), float(degC.max())),
        reference_degC=reference,
        notes=tuple(notes),
        misfits=misfits,
    )


def _drift(
    names: Sequence[str],
    tables: Sequence[Replication],
    covariance: FloatArray,
    spreads: Sequence[FloatArray],
    models: Sequence[SensorModel],
) -> tuple[Drift | None, str]:
    """Variation in use, if the package drifts between replications, and a note; "" if no sensor seems to."""
    told = told_of_drift(dict(zip(names, tables, strict=True)))
    if not drifting_together(tables):
        return None, told
    drift = Drift(
        covariance=_as_it_drifts(covariance, spreads, models),
        df=len(spreads[0]) - 1,
        sigma_V=np.array([table.sigma_w for table in tables]),
        sigma_df=np.array([table.drift_b.df_below for table in tables]),
    )
    return drift, told


def told_of_drift(tables: Mapping[str, Replication]) -> str:
    """A note on drift between replications, of the sensors of a package; "" if none seems to drift."""
    if drifting_together(tuple(tables.values())):
        return (
            "the parameters drift between replications: scatter is that of the replications, and intervals of what is "
            "inferred are for a use that is as far from the calibration as its replications are from one another"
        )
    alone = [name for name, table in tables.items() if drifting(table)]
    together = f"the tests of all {len(tables)} sensors together: intervals are for a use without drift"
    said = f"drift between replications is significant at 5 % in {' and '.join(alone)} alone, but not in {together}"
    return said if alone else ""


def _columns(volts: FloatArray) -> FloatArray:
    """(n, q) columns of an effect, from its terms or from their sum (n,)."""
    given = np.asarray(volts, np.float64)
    return given[:, None] if given.ndim == 1 else given[:, np.any(given != 0, axis=0)]


def _told_apart(
    base: FloatArray, y: FloatArray, shapes: Mapping[str, FloatArray], sensor: str, merged: list[str]
) -> dict[str, FloatArray]:
    """Effects that the points tell from the model and the effects before them; others are added to `merged`."""
    kept: dict[str, FloatArray] = {}
    for effect, columns in shapes.items():
        told = np.column_stack([base, *(one.sum(axis=1) for one in kept.values()), columns.sum(axis=1)])
        try:
            least_squares(told, y, tuple(map(str, range(told.shape[1]))))
            kept[effect] = columns
        except RankError:
            merged.append(f"{effect} of {sensor}")
    return kept


def _beside(
    base: FloatArray, names: Sequence[str], y: FloatArray, shapes: Mapping[str, FloatArray]
) -> tuple[LinearFit, FloatArray, list[str]]:
    """The model with its effects: the fit, its columns, and the effect that each of those beyond the model belongs to.

    Estimates use the terms of an effect in the proportion found by the trace, over all sensors together. Errors do not
    assume that proportion: every term has its own column, if the points determine it.

    Raises:
        RankError: the points do not determine the model with these effects.
    """
    # the plain fit has checked that no column of the model is zero; those of effects are volts and may be small
    one_each = np.column_stack([base, *(columns.sum(axis=1) for columns in shapes.values())]) if shapes else base
    fit = least_squares(one_each, y, (*names, *shapes))
    owners = [effect for effect, columns in shapes.items() for _ in range(columns.shape[1])]
    if len(owners) == len(shapes):
        return fit, one_each, owners
    every = np.column_stack([base, *shapes.values()])
    try:
        free = least_squares(every, y, (*names, *(f"{effect} {k}" for k, effect in enumerate(owners))))
    except RankError:
        return fit, one_each, list(shapes)
    size = dict(zip(shapes, fit.coefficients[base.shape[1] :], strict=True))
    coefficients = np.array([*fit.coefficients[: base.shape[1]], *(size[effect] for effect in owners)])
    return replace(free, coefficients=coefficients, rss=fit.rss), every, owners


def _misfit(alone: LinearFit, table: Replication, axis: str | None) -> Misfit:
    """Remaining lack of fit of one sensor, and the possible change of its parameters."""
    error = None
    if lacks_fit(table):
        reach = reach_beside(alone, table.sigma_bias)
        p = (
            no_roll_parameters(alone.coefficients, reach)
            if axis is None
            else attitude_parameters(AXES[axis], alone.coefficients, reach)
        )
        error = moved_by(p)
    blind = "" if table.blind is None else table.blind.sentence
    S_V = float(np.linalg.norm(alone.coefficients[1:]))
    degrees = sigma_deg(table.sigma_bias, S_V) if S_V > 0 else float("nan")
    return Misfit(table.bias.value, table.bias.limit_95, degrees, error, drifting(table), blind)


def _as_it_drifts(covariance: FloatArray, spreads: Sequence[FloatArray], models: Sequence[SensorModel]) -> FloatArray:
    """(K, K) covariance, where that of the models' own coefficients is the variance between replications and a use.

    A use is a further draw from the distribution of the n replications: their covariance about the mean, plus the
    mean's.
    """
    n = len(spreads[0])
    own = np.concatenate([with_roll(spread.T) for spread in spreads])
    at = np.concatenate([[0], np.cumsum([model.coefficients.size for model in models])[:-1]])
    rows = np.concatenate([start + np.arange(len(COLUMNS)) for start in at])
    out = covariance.copy()
    out[rows, :] = out[:, rows] = 0.0
    out[np.ix_(rows, rows)] = (n + 1) * own @ own.T / (n - 1)
    return out


def _joint(
    fits: Sequence[LinearFit], maps: Sequence[FloatArray], columns: Sequence[FloatArray], residuals: FloatArray
) -> FloatArray:
    """(K, K) covariance of all coefficients, of fits to `columns` (n, k); `maps` convert them to the model's."""

    length = np.linalg.norm(residuals, axis=1)
    correlation = residuals @ residuals.T / np.outer(length, length)
    np.fill_diagonal(correlation, 1.0)
    products = _products(fits, columns)
    blocks = []
    for i, one in enumerate(fits):
        row = []
        for j, other in enumerate(fits):
            product = one.root @ products[i][j] @ other.root.T
            row.append(one.sigma * other.sigma * correlation[i, j] * (maps[i] @ product @ maps[j].T))
        blocks.append(row)
    covariance = np.block(blocks)
    return np.asarray((covariance + covariance.T) / 2)


def _products(fits: Sequence[LinearFit], columns: Sequence[FloatArray]) -> list[list[FloatArray]]:
    """Products of the fits' orthonormal columns X root, some rows at a time: of a million rows, those of one are
    32 MB.
    """
    products = [[np.zeros((one.root.shape[1], other.root.shape[1])) for other in fits] for one in fits]
    for first in range(0, len(columns[0]), AT_ONCE):
        bases = [of[first : first + AT_ONCE] @ one.root for one, of in zip(fits, columns, strict=True)]
        for i, one in enumerate(bases):
            for j, other in enumerate(bases):
                products[i][j] += one.T @ other
    return products


def _model_of(
    shapes: Sequence[tuple[str, FloatArray]], behind: Collection[str], g: FloatArray, warmth: FloatArray, k: int
) -> tuple[tuple[Term, ...], FloatArray]:
    """Terms of all effects, and the (4 + q, k + p) matrix from fitted coefficients to the model's.

    Args:
        shapes: (n,) column of each coefficient beyond the model, with its effect.
        behind: effects that are not applied in use.
        g: (3, n) gravity in the package.
        warmth: (n,) temperature above the reference.
        k: coefficients of the model.
    """
    terms: list[Term] = []
    columns = []
    for effect, shape in shapes:
        weights = {} if effect in behind else _as_terms(effect, shape, g, warmth)
        for term in weights:
            if term not in terms:
                terms.append(term)
        columns.append(weights)
    to_model = np.zeros((len(COLUMNS) + len(terms), k + len(shapes)))
    to_model[: len(COLUMNS), :k] = with_roll(np.eye(k))
    for column, weights in enumerate(columns, start=k):
        for term, weight in weights.items():
            to_model[len(COLUMNS) + terms.index(term), column] = weight
    return tuple(terms), to_model


def _as_terms(effect: str, shape: FloatArray, g: FloatArray, warmth: FloatArray) -> dict[Term, float]:
    """An effect as a polynomial in gravity and temperature, the lowest exact one."""
    scale = float(np.linalg.norm(shape))
    for basis in _BASES:
        terms = [Term(powers, d, effect) for powers, d in basis]
        columns = np.column_stack([t.column(g, warmth) for t in terms])
        weights = np.linalg.lstsq(columns, shape, rcond=1e-10)[0]
        if np.linalg.norm(shape - columns @ weights) <= _EXACT * scale:
            reach = np.abs(weights) * np.linalg.norm(columns, axis=0)
            kept = reach > _EXACT * scale
            return {t: float(w) for t, w, keep in zip(terms, weights, kept, strict=True) if keep}
    raise NotApplicable(effect)


def _axis_letter(name: str, data: AttitudeData, fit: LinearFit, k: int) -> str:
    if data.has_roll:
        return "xyz"[nominal_axis(name, fit.coefficients[:k], data.axes)]
    return "xyz"[int(np.argmax(np.abs(sensitive_axis(fit.coefficients[:k]))))]
