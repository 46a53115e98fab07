"""From the residual to the effect: the whole of a trace."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.attitude import attitude_columns
from fitter.calibration import AttitudeFit
from fitter.data import AttitudeData
from fitter.effects import CATALOGUE, Effect, separate
from fitter.replication import Replication
from fitter.trace.aliases import Rival
from fitter.trace.estimate import Estimate, concerns, estimate
from fitter.trace.family import Family, family_of
from fitter.trace.judge import AttitudeJudge
from fitter.trace.noise import noise_findings, outlier_finding
from fitter.trace.outliers import outliers
from fitter.trace.problem import Problem, pose, raw_columns
from fitter.trace.remainder import shared_attitude, strongest_wave
from fitter.trace.restarts import search_with_restarts
from fitter.trace.result import Explanation, Found, FoundEffect, SensorTrace, Trace, Unnamed, predict, verdict
from fitter.trace.score import RESOLVED, score
from fitter.trace.search import ROUNDS, names_of, prune, search_and_name
from fitter.trace.wander import expected, with_wander

SEED = 20260115
UNEXPLAINED = 1e-3
"""Lack of fit or drift below this probability is something that remains."""
SHOWS = 3.0
"""An effect on the package is reported for the sensors in which it amounts to this many standard errors."""


def trace(
    data: AttitudeData,
    catalogue: Sequence[Effect] = CATALOGUE,
    seed: int = SEED,
    *,
    temperature: bool = False,
    validate: bool = True,
) -> Trace:
    """Find what the declared attitude model lacks.

    Args:
        data: a pitch-roll run; any number of sensors, judged together.
        catalogue: effects to look for.
        seed: of the simulated null; the same data and seed give the same answer.
        temperature: whether offset and sensitivity follow the sensor's temperature in the declared model.
        validate: repeat the search without each replication for the left-out error, which takes most of the time.

    Raises:
        fitter.linear.RankError: the points visited do not determine the declared model.
        ValueError: the declared model has temperature, and none was recorded or it never changed.

    """
    aside, judge, found, family = _without_outliers(data, catalogue, seed, temperature=temperature)
    problem = judge.problem
    before, after = estimate(problem, ()), estimate(problem, found)
    classes = {name: judge.rivals(found, name) for name in names_of(problem.candidates, found)}
    cv = None
    if validate:
        cv = left_out(problem.scene.data, catalogue, family, temperature=temperature, anything=bool(found))
    sensors = {
        sensor: _sensor(judge, data, aside, before, after, classes, i, None if cv is None else cv[:, i])
        for i, sensor in enumerate(problem.sensors)
    }
    chosen = tuple(problem.candidates[j] for j in after.chosen)
    alternatives = {
        name: tuple(
            Explanation(r.effect, tuple(problem.candidates[j] for j in r.terms), r.sigmas, r.alias)
            for r in explanations
        )
        for name, explanations in classes.items()
    }
    return Trace(sensors, problem.scene, chosen, after.gamma, len(data), tuple(aside.tolist()), alternatives)


def _without_outliers(
    data: AttitudeData, catalogue: Sequence[Effect], seed: int, *, temperature: bool
) -> tuple[IntArray, AttitudeJudge, tuple[int, ...], Family]:
    """Search; again without the readings that stand out beside what was found; until none is to be added.

    A reading that stood out only of what was not yet in the model comes back.
    """
    aside = np.zeros(0, np.int64)
    for last in (False, False, True):
        kept = data if not aside.size else data.take(np.setdiff1d(np.arange(len(data)), aside))
        problem = pose(kept, catalogue, temperature=temperature)
        family = family_of(problem, score(problem, ()), seed)
        judge, found = _settle(problem, family)
        again = outliers(data, residual_of(judge.problem, estimate(judge.problem, found), data))[0]
        if last or np.array_equal(again, aside):
            break
        aside = again
    return aside, judge, found, family


def residual_of(problem: Problem, fitted: Estimate, data: AttitudeData) -> FloatArray:
    """(S, n) outputs less what was fitted, V, of any observations."""
    chosen = [problem.candidates[j] for j in fitted.chosen]
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=problem.scene.roll)
    model = [predict(h, data, *pair) for pair in zip(fitted.fits, fitted.temperatures, strict=True)]
    effects = raw_columns(problem.scene.on(data), chosen) @ fitted.gamma
    return np.stack([data.outputs[s] for s in data.sensors]) - effects - np.stack(model)


def left_out(
    data: AttitudeData,
    catalogue: Sequence[Effect],
    family: Family,
    *,
    temperature: bool = False,
    anything: bool = True,
) -> FloatArray | None:
    """(2, S) rms error on replications left out, V, before and after; None where fewer than two can be.

    The search is repeated without the replication that is left out, whose own offset is predicted as zero. Where
    nothing was found in the whole, there is nothing to repeat.
    """
    if data.replicates.size < 2:
        return None
    squares = np.zeros((2, len(data.sensors)))
    for replicate in data.replicates:
        inside = data.replicate != replicate
        rest, aside = data.take(np.flatnonzero(inside)), data.take(np.flatnonzero(~inside))
        try:
            problem = pose(rest, catalogue if anything else (), temperature=temperature)
        except ValueError:
            return None
        squares += _squares_aside(problem, family, aside, anything=anything)
        del problem  # or the next one would be built beside it
    return np.asarray(np.sqrt(squares / len(data)))


def _squares_aside(problem: Problem, family: Family, aside: AttitudeData, *, anything: bool) -> FloatArray:
    """(2, S) sums of squared errors on data that were set `aside`, before and after a search of the rest."""
    found: tuple[int, ...] = ()
    if anything:
        judge, found = _settle(problem, family)
        problem = judge.problem
    return np.stack([np.sum(residual_of(problem, estimate(problem, one), aside) ** 2, axis=1) for one in ((), found)])


def _settle(problem: Problem, family: Family) -> tuple[AttitudeJudge, tuple[int, ...]]:
    """Search; then judge what was found against the random walk that is left, until nothing changes.

    A walk is looked for beside the effects and not before them: an effect of temperature not yet in the model looks
    like one, and would be judged against itself.
    """
    judge, chosen = search_with_restarts(AttitudeJudge(problem, family))
    by = expected(problem)
    if by is None:
        return judge, chosen
    for _ in range(ROUNDS):
        walking = with_wander(judge.problem, chosen, by)
        if np.all((walking.wander > 0) == (judge.problem.wander > 0)):
            break
        judge = AttitudeJudge(walking, family)
        judge, chosen = search_and_name(judge, prune(judge, chosen))
    return judge, chosen


def _sensor(
    judge: AttitudeJudge,
    whole: AttitudeData,
    aside: IntArray,
    before: Estimate,
    after: Estimate,
    classes: dict[str, tuple[Rival, ...]],
    i: int,
    cv: FloatArray | None,
) -> SensorTrace:
    problem = judge.problem
    sensor = problem.sensors[i]
    declared: AttitudeFit = problem.fits[sensor]
    effects = sorted(
        (e for name in classes if (e := _found(judge, whole, before, after, classes[name], name, i)) is not None),
        key=lambda effect: -effect.share,
    )
    unnamed = _unnamed(problem, after, i)
    return SensorTrace(
        sensor=sensor,
        declared=declared.declared,
        verdict=verdict(bool(effects), bool(unnamed)),
        before=before.tables[i],
        after=after.tables[i],
        cv_rms_before=None if cv is None else float(cv[0]),
        cv_rms_after=None if cv is None else float(cv[1]),
        effects=tuple(effects),
        unnamed=unnamed,
        shared_attitude_before=shared_attitude(problem, before.corrected[i]),
        shared_attitude_after=shared_attitude(problem, after.corrected[i]),
        fit=after.fits[i],
        temperature=after.temperatures[i],
        S_V=declared.parameters.S_V,
        residual_before_V=residual_of(problem, before, whole)[i],
        residual_after_V=residual_of(problem, after, whole)[i],
        temperature_recorded=problem.scene.temperature_degC is not None,
        noise=(*noise_findings(problem, after, i), *_outliers(problem, whole, aside, after, i)),
    )


def _outliers(problem: Problem, whole: AttitudeData, aside: IntArray, after: Estimate, i: int) -> tuple[Found, ...]:
    """The readings of sensor `i` that were left out, and what the fit would be with them."""
    if not aside.size:
        return ()
    sd = outliers(whole, residual_of(problem, after, whole))[1][i]
    own = aside[np.abs(sd[aside]) > SHOWS]
    if not own.size:
        return ()
    h = problem.fits[problem.sensors[i]].columns(whole.pitch_deg, whole.roll_deg)
    effects = raw_columns(problem.scene.on(whole), [problem.candidates[j] for j in after.chosen])[i]
    columns = np.column_stack([h, effects[:, np.any(effects != 0, axis=0)]])
    kept = np.setdiff1d(np.arange(len(whole)), aside)
    spread = np.linalg.pinv(columns[kept].T @ columns[kept])
    y = whole.outputs[problem.sensors[i]]
    with_all = np.linalg.lstsq(columns, y, rcond=None)[0]
    without = np.linalg.lstsq(columns[kept], y[kept], rcond=None)[0]
    error = np.sqrt(_pure_variance(after.tables[i]) * np.maximum(np.diag(spread), np.finfo(float).tiny))
    return (outlier_finding(problem, whole, own, sd, float(np.max(np.abs(with_all - without) / error)), i),)


def _found(
    judge: AttitudeJudge,
    whole: AttitudeData,
    before: Estimate,
    after: Estimate,
    explanations: tuple[Rival, ...],
    name: str,
    i: int,
) -> FoundEffect | None:
    """The effect as sensor `i` shows it; None where it does not."""
    problem = judge.problem
    sensor, picked = problem.sensors[i], list(after.chosen)
    mine = [k for k, j in enumerate(picked) if problem.candidates[j].effect.name == name]
    shown = [k for k in mine if _size(problem, after, k, i) > SHOWS]
    if not shown:
        return None
    effect = problem.candidates[picked[shown[0]]].effect
    contribution = raw_columns(problem.scene, [problem.candidates[picked[k]] for k in mine])[i] @ after.gamma[mine]
    formulas = [problem.candidates[picked[k]].term.as_formula(problem.scene, sensor) for k in shown]
    parts = {k: problem.candidates[picked[k]] for k in mine}
    own = {part.term.name: float(after.gamma[k]) for k, part in parts.items() if part.sensor in (None, sensor)}
    stderr = np.sqrt(np.diag(after.covariance))
    h = problem.fits[sensor].columns(problem.scene.data.pitch_deg, problem.scene.data.roll_deg)
    shape = [problem.candidates[picked[k]] for k in mine]
    without = after.corrected[i] + contribution
    own_columns = np.column_stack([h, problem.fits[sensor].beside(problem.scene.data)])
    rss_without = float(np.sum((without - own_columns @ np.linalg.lstsq(own_columns, without, rcond=None)[0]) ** 2))
    excess = before.fits[i].rss - after.fits[i].df * _pure_variance(after.tables[i])
    p = min(judge.p_adjusted(after.chosen, picked[k]) for k in shown)
    best = next(rival for rival in explanations if rival.effect == name)
    alike = [problem.candidates[r.terms[0]].effect for r in explanations if r.alias and r.effect != name]
    peak = float(np.max(np.abs(contribution)))
    return FoundEffect(
        effect=name,
        cause=effect.cause,
        stratum=judge.stratum_of(after.chosen, picked[shown[0]]),
        terms=tuple(text for text, _ in formulas),
        coefficients=tuple(float(after.gamma[k] * f) for k, (_, f) in zip(shown, formulas, strict=True)),
        stderr=tuple(float(stderr[k] * abs(f)) for k, (_, f) in zip(shown, formulas, strict=True)),
        unit=effect.unit,
        size=effect.size(own, problem.fits[sensor].parameters.S_V),
        p_adjusted=p,
        p_adjusted_is_bound=p == judge.family.least,
        share=float(np.clip((rss_without - after.fits[i].rss) / excess, 0.0, 1.0)) if excess > 0 else 0.0,
        aliases=tuple(other.name for other in alike),
        separation={r.effect: round(max(r.sigmas - best.sigmas, 0.0), 2) for r in explanations if r.effect != name},
        separate_by=f"{_experiments(effect, alike)}; it reaches {peak:.2g} V "
        f"({np.degrees(peak / problem.fits[sensor].parameters.S_V):.2g} deg) here",
        contribution_V=raw_columns(problem.scene.on(whole), shape)[i] @ after.gamma[mine],
        against=effect.against,
    )


def _experiments(effect: Effect, aliases: Iterable[Effect]) -> str:
    """What to measure: against each alias if there are any, else to confirm the effect."""
    return "; ".join(dict.fromkeys(separate(effect, alias) for alias in aliases)) or effect.separate_by


def _size(problem: Problem, after: Estimate, k: int, i: int) -> float:
    """Standard errors that term `k` of the model amounts to in sensor `i` by itself."""
    j = after.chosen[k]
    length = np.sqrt(problem.products["declared"].columns[i, j, j])
    sigma = np.sqrt(_pure_variance(after.tables[i]))
    return float(abs(after.gamma[k]) * length / sigma) if concerns(problem, after.chosen[k])[i] else 0.0


def _pure_variance(table: Replication) -> float:
    return table.sigma_pr**2 if np.isfinite(table.sigma_pr) else table.sigma_E**2


def _unnamed(problem: Problem, after: Estimate, i: int) -> tuple[Unnamed, ...]:
    table, rest = after.tables[i], []
    if table.sigma_E < RESOLVED * np.ptp(after.corrected[i]):
        return ()
    if table.bias.p < UNEXPLAINED:
        rest.append(strongest_wave(problem, after.corrected[i]))
    if problem.wander[i] > 0:
        rest.append(Unnamed("along the run: the offset takes a random walk", _walk_share(problem, i)))
    elif table.drift.p < UNEXPLAINED:
        share = 1.0 - _pure_variance(table) / table.sigma_E**2
        rest.append(Unnamed("between replications: the parameters drift", float(np.clip(share, 0.0, 1.0))))
    return tuple(rest)


def _walk_share(problem: Problem, i: int) -> float:
    """Share of the variance of a sensor's residual that the walk holds, within a replication."""
    data = problem.scene.data
    spread = problem.wander[i] * len(data) / data.replicates.size / 6
    return float(spread / (1.0 + spread))
