"""Report of each sensor: its effects, the remainder, and its noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.replication import Replication
from rig.fitter.trace.aliases import Rival, separation
from rig.fitter.trace.doubts import beside_a_wander, by_chance, error_rises
from rig.fitter.trace.drawn import drawn, drawn_instead, drawn_period
from rig.fitter.trace.found import experiments, of_left_out, verdict, with_shares
from rig.fitter.trace.limits import limit
from rig.fitter.trace.lines import CLEAR
from rig.fitter.trace.not_kept import NotKept, for_others
from rig.fitter.trace.outcome import CONDITIONAL, Finding, Parameter, WithError, remains
from rig.fitter.trace.shares import of_rest, shares, unnamed_part
from rig.fitter.trace.signs import Refused
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import Scene, separate
from rig.procedures.attitude.effects.unnamed import NAMELESS
from rig.procedures.attitude.fit import AttitudeFit, coefficient_table, temperature_table
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.trace.estimate import Estimate, concerns, estimate, predict
from rig.procedures.attitude.trace.fine import turns_with
from rig.procedures.attitude.trace.grid import same_on_grid
from rig.procedures.attitude.trace.judge import AttitudeJudge
from rig.procedures.attitude.trace.levels import LEVELS
from rig.procedures.attitude.trace.noise import alone_finding, noise_findings
from rig.procedures.attitude.trace.problem import Problem, raw_columns
from rig.procedures.attitude.trace.remainder import shared_attitude, strongest_wave
from rig.procedures.attitude.trace.result import FoundEffect, SensorTrace, side
from rig.procedures.attitude.trace.score import RESOLVED
from rig.procedures.attitude.trace.unmodelled import UnmodelledSmooth

UNEXPLAINED = limit("unexplained", "pitch-roll")
"""Probability of lack of fit or drift below which a remainder is reported."""
LEAVING_OUT = "each replication in turn left out of selection and fit, its offset predicted as zero"
SHOWS = 3.0
"""Minimum size of an effect on the package, in standard errors, for a report in a sensor; it is always reported in the
sensor with the largest size.
"""


def sensor_trace(
    judge: AttitudeJudge,
    whole: AttitudeData,
    off: FloatArray,
    not_kept: tuple[NotKept, ...],
    before: Estimate,
    after: Estimate,
    stated: Estimate,
    classes: dict[str, tuple[Rival, ...]],
    i: int,
    cv: FloatArray | None,
    refused: Sequence[Refused],
    unmodelled: UnmodelledSmooth,
    doubts: Mapping[str, str],
) -> SensorTrace:
    """Findings in sensor `i`.

    Args:
        judge: of the run after the search.
        whole: the run as it was read.
        off: (S, n) by how much readings that stand alone are reduced in the judge's, V.
        not_kept: candidates of any sensor that were not kept.
        before: the declared model.
        after: the same with the findings.
        stated: the same with those that lower the sensor's error.
        classes: all explanations of each effect found, by its name.
        i: the sensor.
        cv: (2,) rms errors left out, before and after.
        refused: causes that would fit, in any sensor.
        unmodelled: shapes without a name beside what was found.
        doubts: reasons for doubt about names, by name.

    """
    problem = judge.problem
    sensor = problem.sensors[i]
    declared: AttitudeFit = problem.fits[sensor]
    inside = {problem.candidates[j].effect.name for j in (stated.left_in[i] if stated.left_in else ())}
    rest = _unnamed(problem, after, unmodelled, i)
    own = (judge.candidates[j].effect for j in after.chosen)
    slow = {effect.name for effect in own if effect.against == "elapsed_s" and effect.scope != "package"}
    shown = [e for name in classes if (e := _found(judge, after, classes[name], name, i)) is not None]
    divided = _shares(problem, after, [effect.effect for effect in shown], unnamed_part(rest), i)

    def doubt(effect: Finding) -> str | None:
        walks = problem.wander[i] > 0 and effect.effect in slow
        rises = error_rises() if effect.effect in inside else None
        return (
            doubts.get(effect.effect) or rises or (beside_a_wander() if walks else None) or by_chance(effect.p_adjusted)
        )

    every = with_shares(shown, divided, doubt, inside)
    fell = not inside and stated.tables[i].sigma_E < before.tables[i].sigma_E
    smooth = tuple(effect for effect in every if effect.effect in NAMELESS)
    effects = tuple(effect for effect in every if effect.effect not in NAMELESS)
    unnamed = (*(_added(problem, after, one, i) for one in smooth), *of_rest(divided, rest))
    errors = (None, None) if cv is None else (float(cv[0]), float(cv[1]))
    S_V, tables = declared.parameters.S_V, (before.tables[i], stated.tables[i])
    shared = [shared_attitude(problem, fitted.corrected[i]) for fitted in (before, stated)]
    fit, temperature = stated.fits[i], stated.temperatures[i]
    own_rows = coefficient_table(fit) | temperature_table(temperature, S_V, fit.df)
    return SensorTrace(
        sensor=sensor,
        declared=declared.declared,
        verdict=verdict(found=bool(effects), fell=fell, rest=unnamed, doubtful=any(e.doubtful for e in effects)),
        before=tables[0],
        after=tables[1],
        rows=(side(tables[0], errors[0], shared[0], S_V), side(tables[1], errors[1], shared[1], S_V)),
        cv_rms_before=errors[0],
        cv_rms_after=errors[1],
        effects=(
            *effects,
            *noise_findings(problem, after, i),
            *alone_finding(problem, after, off, residual_of(problem, after, whole), i),
        ),
        unnamed=unnamed,
        instead=drawn_instead(unmodelled, tuple(e.effect for e in effects if e.doubtful), i),
        refused=tuple(one for one in refused if sensor in one.sensors),
        shared_attitude_before=shared[0],
        shared_attitude_after=shared[1],
        fit=fit,
        temperature=temperature,
        S_V=S_V,
        residual_before_V=residual_of(problem, before, whole)[i],
        residual_after_V=residual_of(problem, stated, whole)[i],
        fitted=(
            *(Parameter(name, WithError.of_json(row)) for name, row in own_rows.items()),
            *(one for effect in (*effects, *smooth) for one in effect.parameters),
        ),
        notes=(
            *(one.sentence for one in refused if sensor in one.sensors),
            *(one.sentence for one in not_kept if one.sensor in (None, sensor)),
            *(() if fell else (for_others(effect.effect) for effect in effects)),
            *_notes(tables, problem.scene, found=bool(effects), smooth=bool(smooth)),
            *of_left_out(errors[0], errors[1], "replications", LEAVING_OUT, asked=bool(every)),
        ),
    )


def _notes(tables: tuple[Replication, Replication], scene: Scene, *, found: bool, smooth: bool) -> Iterator[str]:
    before, after = tables
    if after.blind is not None:
        yield after.blind.sentence
    if scene.temperature_degC is None:
        yield "no sensor temperature was recorded: temperature effects could not be tested"
    if found and after.drift_b.value > before.drift_b.value:
        yield "T_b rose because the lack of fit that was removed stood in its denominator; p_drift is free of that"
    if found:
        yield CONDITIONAL
    if smooth:
        yield "smooth terms without a cause are in the fit: they describe these points and explain nothing"


def _found(
    judge: AttitudeJudge,
    after: Estimate,
    explanations: tuple[Rival, ...],
    name: str,
    i: int,
) -> FoundEffect | None:
    """The effect in sensor `i`; None if it has none there."""
    problem = judge.problem
    sensor, picked = problem.sensors[i], list(after.chosen)
    mine = [k for k, j in enumerate(picked) if problem.candidates[j].effect.name == name]
    sizes = np.array([[_size(problem, after, k, one) for k in mine] for one in range(len(problem.sensors))])
    shown = [k for k, size in zip(mine, sizes[i], strict=True) if size >= min(SHOWS, float(sizes.max()))]
    if not shown:
        return None
    effect = problem.candidates[picked[shown[0]]].effect
    columns = raw_columns(problem.scene, [problem.candidates[picked[k]] for k in mine])[i] * after.gamma[mine]
    formulas = [problem.candidates[picked[k]].term.as_formula(problem.scene, sensor) for k in shown]
    parts = {k: problem.candidates[picked[k]] for k in mine}
    own = {part.term.name: k for k, part in parts.items() if part.sensor in (None, sensor)}
    stratum = judge.stratum_of(after.chosen, picked[shown[0]])
    stderr = np.sqrt(np.diag(after.covariance))
    p = min(judge.p_adjusted(after.chosen, picked[k]) for k in shown)
    alike = [problem.candidates[r.terms[0]].effect for r in explanations if r.alias and r.effect != name]
    peak = float(np.max(np.abs(columns.sum(axis=1))))
    gear = same_on_grid(name, problem.scene.data)
    further = experiments(effect, alike, separate) + ("" if gear is None else f"; {gear.separate_by}")
    return FoundEffect(
        kind="effect",
        effect=name,
        cause=effect.cause,
        stratum=stratum,
        terms=tuple(text for text, _ in formulas),
        coefficients=tuple(float(after.gamma[k] * f) for k, (_, f) in zip(shown, formulas, strict=True)),
        stderr=tuple(float(stderr[k] * abs(f)) for k, (_, f) in zip(shown, formulas, strict=True)),
        unit=effect.unit,
        size=effect.size(
            {term: float(after.gamma[k]) for term, k in own.items()},
            problem.fits[sensor].parameters.S_V,
            {term: float(stderr[k]) for term, k in own.items()},
        ),
        p_adjusted=p,
        p_adjusted_is_bound=judge.is_bound(p),
        share=0.0,  # together for all effects: `_shares`
        aliases=tuple(dict.fromkeys([*(other.name for other in alike), *([gear.effect] if gear else [])])),
        separation=separation(explanations, name),
        separate_by=f"{further}; it reaches {peak:.2g} V "
        f"({np.degrees(peak / problem.fits[sensor].parameters.S_V):.2g} deg) here",
        columns_V=columns,
        df=min(after.fits[i].df, *after.dfs[shown].tolist()),
        against=effect.against,
    )


def _shares(problem: Problem, after: Estimate, names: list[str], unnamed: float, i: int) -> FloatArray:
    """Share of each effect in the error of sensor `i` beyond scatter; `unnamed`: unexplained part of the remainder."""
    data, table = problem.scene.data, after.tables[i]
    declared = problem.fits[problem.sensors[i]]
    columns = np.column_stack([declared.columns(data.pitch_deg, data.roll_deg), declared.beside(data)])
    basis = orthonormal(columns)
    effects = [problem.candidates[j] for j in after.chosen]
    parts = raw_columns(problem.scene, effects)[i] * after.gamma
    added = [parts[:, [k for k, c in enumerate(effects) if c.effect.name == name]].sum(axis=1) for name in names]
    every = np.column_stack([*added, data.outputs[problem.sensors[i]]])
    *beyond, residual = (every - basis @ (basis.T @ every)).T
    known = np.isfinite(table.sigma_pr)
    variance = table.sigma_pr**2 if known else table.sigma_E**2 * (1.0 - unnamed)
    return shares(beyond, residual, after.fits[i].df * float(variance))


def _size(problem: Problem, after: Estimate, k: int, i: int) -> float:
    """Size of term `k` of the model in sensor `i`, in standard errors of that sensor alone."""
    j = after.chosen[k]
    length = np.sqrt(problem.products["declared"].of([j], [j])[i, 0])
    sigma = np.sqrt(_pure_variance(after.tables[i]))
    return float(abs(after.gamma[k]) * length / sigma) if concerns(problem, after.chosen[k])[i] else 0.0


def _pure_variance(table: Replication) -> float:
    return table.sigma_pr**2 if np.isfinite(table.sigma_pr) else table.sigma_E**2


def left_without_a_name(problem: Problem, unmodelled: UnmodelledSmooth, i: int) -> bool:
    """Whether something without a name, that is not of the noise, is left in sensor `i` beside what was found."""
    rest = _unnamed(problem, estimate(problem, unmodelled.chosen), unmodelled, i)
    return any(one.stratum != "noise" for one in rest)


def _unnamed(problem: Problem, after: Estimate, unmodelled: UnmodelledSmooth, i: int) -> tuple[Finding, ...]:
    table, rest = after.tables[i], list[Finding]()
    if table.sigma_E < RESOLVED * np.ptp(after.corrected[i]):
        return ()
    between, within = (unmodelled.left_in(i, level) for level in LEVELS[1:])
    clear = between is not None and between.p < UNEXPLAINED
    if table.bias.p < UNEXPLAINED and not (clear and unmodelled.outdoes):
        shape = unmodelled.drawn_points(between, table.bias.p, i)
        rest.append(replace(strongest_wave(problem, after.corrected[i]), shape=shape))
    elif between is not None and clear:
        part = _part(table, between.remainder.share)
        rest.append(remains(between.where, part, shape=drawn(unmodelled, between, i)))
    fine = unmodelled.fine
    if fine is not None and fine.p < CLEAR and turns_with(problem.scene, fine.over, i):
        where = f"between points, package: an error of {fine.over}, {fine.where}"
        rest.append(remains(where, _part(table, fine.share), shape=drawn_period(unmodelled, fine, i)))
    line = unmodelled.lines[i]
    if line is not None and line.p < CLEAR:
        rest.append(remains(line.where, _part(table, line.share), shape=drawn_period(unmodelled, line, i)))
    elif within is not None and within.p < UNEXPLAINED and not (problem.wander[i] > 0 and within.place.timed):
        part = _part(table, within.remainder.share)
        rest.append(remains(within.where, part, shape=drawn(unmodelled, within, i)))
    if problem.wander[i] > 0:
        walk = "along the run: the offset takes a random walk"
        rest.append(remains(walk, _walk_share(problem, i), stratum="noise"))
    elif table.drift.p < UNEXPLAINED:
        share = 1.0 - _pure_variance(table) / table.sigma_E**2
        drift = unmodelled.drawn_drift(table.drift.p, i)
        rest.append(remains("between replications: the parameters drift", float(np.clip(share, 0.0, 1.0)), shape=drift))
    return tuple(rest)


def _part(table: Replication, share: float) -> float:
    """Share of what is left that lies in a shape, from its share of the residual point by replication."""
    known = np.isfinite(table.sigma_pr) and table.sigma_E > 0
    return float(np.clip(share * table.sigma_pr**2 / table.sigma_E**2 if known else share, 0.0, 1.0))


def _added(problem: Problem, after: Estimate, smooth: FoundEffect, i: int) -> Finding:
    """Place of a term without a cause that was added to sensor `i`."""
    own = (problem.candidates[j] for j in after.chosen)
    groups = dict.fromkeys(c.term.group for c in own if c.cause == (smooth.effect, problem.sensors[i]))
    level = "along the run" if smooth.against == "elapsed_s" else "between points"
    return remains(f"{level}, {'; '.join(groups)}: taken up by a smooth term without a cause", smooth.share, added=True)


def _walk_share(problem: Problem, i: int) -> float:
    """Share of a random walk in the variance of a sensor's residual within a replication."""
    data = problem.scene.data
    spread = problem.wander[i] * len(data) / data.replicates.size / 6
    return float(spread / (1.0 + spread))


def residual_of(problem: Problem, fitted: Estimate, data: AttitudeData) -> FloatArray:
    """(S, n) outputs minus the fit, V, for any observations."""
    chosen = [problem.candidates[j] for j in fitted.chosen]
    h = attitude_columns(data.pitch_deg, data.roll_deg, roll=problem.scene.roll)
    model = [predict(h, data, *pair) for pair in zip(fitted.fits, fitted.temperatures, strict=True)]
    raw = raw_columns(problem.scene.on(data), chosen)
    effects = np.einsum("snq,sq->sn", raw, fitted.taken * fitted.gamma)
    return np.asarray(np.stack([data.outputs[s] for s in data.sensors]) - effects - np.stack(model))
