"""The coefficients of the effects found, fitted together with the declared model of every sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray
from rig.fitter.replication import Replication, Rows, analyse, sigma_E
from rig.fitter.trace.engine.in_strata import Fitted
from rig.fitter.trace.keep import LeftIn, taken_out
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.temperature import Temperature
from rig.procedures.attitude.trace.posed import engine_of, posed, units_of
from rig.procedures.attitude.trace.problem import Problem, raw_columns
from rig.procedures.attitude.trace.robust import walked
from rig.procedures.attitude.trace.score import errors


@dataclass(frozen=True, eq=False)
class Estimate:
    """Declared model and effects, fitted together.

    Attributes:
        chosen: indices of the candidates in the model.
        told_apart: those of them that are not combinations of earlier ones; the others have zero coefficients.
        gamma: (q,) their coefficients.
        covariance: (q, q) of them, conditional on the selection.
        dfs: (q,) degrees of freedom of their errors.
        corrected: (S, n) outputs minus the effects, and minus the temperature terms of the declared model, V.
        fits: of the declared model to the corrected outputs.
        temperatures: temperature terms of the declared model of each sensor; None without.
        plain: `fits` without the errors of the effects' coefficients.
        observations: rows of the declared model.
        beside: of each sensor, (n, q) columns fitted beside it.
        left_in: of each sensor, candidates that its outputs keep; () where all are taken out of all.
    """

    chosen: tuple[int, ...]
    told_apart: tuple[int, ...]
    gamma: FloatArray
    covariance: FloatArray
    dfs: FloatArray
    corrected: FloatArray
    fits: tuple[LinearFit, ...]
    temperatures: tuple[Temperature | None, ...]
    plain: tuple[LinearFit, ...]
    observations: Rows
    beside: tuple[FloatArray, ...]
    left_in: tuple[LeftIn, ...] = ()

    @property
    def taken(self) -> FloatArray:
        """(S, q) one where a candidate is taken out of a sensor's output, else zero."""
        return taken_out(self.chosen, self.left_in, len(self.fits))

    @cached_property
    def tables(self) -> tuple[Replication, ...]:
        """Table 2 of each sensor, with the effects removed."""
        every, rows = zip(self.plain, self.beside, self.corrected, strict=True), self.observations
        return tuple(analyse(fit, rows.beside(extra), output, extra.shape[1]) for fit, extra, output in every)


def stated(fitted: Estimate) -> FloatArray:
    """(S,) standard error of an observation of each sensor, V: `sigma_E` of its table."""
    each = zip(fitted.plain, fitted.beside, strict=True)
    return np.array([sigma_E(fit, extra.shape[1]) for fit, extra in each])


def estimate(problem: Problem, chosen: tuple[int, ...], left_in: Sequence[LeftIn] = ()) -> Estimate:
    """Fit the `chosen` candidates, some of which may be `left_in` a sensor's outputs; known fits are used again."""
    if any(left_in):
        return _estimate(problem, chosen, left_in)
    known = problem.estimates
    if chosen not in known:
        known[chosen] = _estimate(problem, chosen)
    found: Estimate = known[chosen]
    return found


def _joint(fit: LinearFit, h: FloatArray, effects: FloatArray, covariance: FloatArray) -> LinearFit:
    """A fit to outputs minus effects (n, q), with errors that include those of the effects' coefficients."""
    if not effects.shape[1] or fit.sigma == 0.0:
        return fit
    taken = np.linalg.lstsq(h, effects, rcond=None)[0]
    whole = fit.root @ fit.root.T + taken @ covariance @ taken.T / fit.sigma**2
    try:
        root = np.linalg.cholesky(whole)
    except np.linalg.LinAlgError:  # many effects that look alike: a variance is below zero by rounding
        values, along = np.linalg.eigh(covariance)
        spread = taken @ along * np.sqrt(np.maximum(values, 0.0)) / fit.sigma
        root = np.asarray(np.linalg.qr(np.column_stack([fit.root, spread]).T, mode="r")).T
    return replace(fit, root=np.asarray(root), beside=fit.beside + effects.shape[1])


def coefficients(problem: Problem, chosen: tuple[int, ...]) -> Fitted:
    """Coefficients of the `chosen` candidates beside the likeliest errors.

    A candidate whose column is a combination of earlier ones has a zero coefficient. To their errors a walk of the
    offset within replications is added, if there is one.
    """
    engine = engine_of(problem, chosen)
    at = engine.beside(units_of(problem, chosen)).best
    found = engine.problem.fitted(at, posed(problem).column[list(chosen)])
    if not chosen or not np.any(problem.wander):
        return found
    white = problem.columns_at("replications", chosen) / errors(problem, chosen)[:, None, None]
    spread = engine.problem.spread(at, posed(problem).column[list(chosen)])
    return found._replace(covariance=found.covariance + spread @ walked(problem, white) @ spread)


def concerns(problem: Problem, j: int) -> FloatArray:
    """(S,) share of each sensor in the information about candidate `j`."""
    sigma = errors(problem, ())
    length2 = problem.products["declared"].of([j], [j])[:, 0] / sigma**2
    return np.asarray(length2 / length2.sum())


def predict(h: FloatArray, data: AttitudeData, fit: LinearFit, temperature: Temperature | None) -> FloatArray:
    """(n,) outputs in volts of the declared model for observations with rows `h` (n, k)."""
    volts = fit.predict(h)
    return volts if temperature is None else volts + temperature.volts(h, data)


def _estimate(problem: Problem, chosen: tuple[int, ...], left_in: Sequence[LeftIn] = ()) -> Estimate:
    picked = list(chosen)
    gamma, covariance, dfs = coefficients(problem, chosen)
    data = problem.scene.data
    effects = raw_columns(problem.scene, [problem.candidates[j] for j in picked])
    corrected = np.stack([data.outputs[s] for s in problem.sensors])
    taken = taken_out(chosen, left_in, len(problem.sensors))
    corrected -= np.einsum("snq,sq->sn", effects, taken * gamma)
    h = data.rows.columns
    fits, temperatures, plain, every = [], [], [], []
    for i, sensor in enumerate(problem.sensors):
        declared = problem.fits[sensor]
        fit, temperature = declared.refitted(data, corrected[i])
        if temperature is not None:
            corrected[i] -= temperature.volts(h, data)
        own = [k for k, j in enumerate(picked) if concerns(problem, j)[i] > 0.01 and taken[i, k] > 0]
        extra = np.column_stack([declared.beside(data), effects[i][:, own]])
        plain.append(fit)
        every.append(extra)
        fits.append(_joint(fit, h, effects[i][:, own], covariance[np.ix_(own, own)]))
        temperatures.append(temperature)
    apart = tuple(j for j, error in zip(chosen, np.diag(covariance), strict=True) if error > 0)
    return Estimate(
        chosen,
        apart,
        gamma,
        covariance,
        dfs,
        corrected,
        tuple(fits),
        tuple(temperatures),
        tuple(plain),
        data.rows,
        tuple(every),
        tuple(left_in),
    )
