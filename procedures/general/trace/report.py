"""Findings in a table, combined."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, SLOPES_DIFFER
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.doubts import (
    MANY,
    beside_a_wander,
    beyond_chance,
    by_chance,
    not_predicted,
    several_causes,
)
from rig.fitter.trace.drawn import drawn_instead
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.judge import MANY as SIMULATED
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.shared import Shared
from rig.fitter.trace.found import of_left_out, parameters_of, verdict, with_shares
from rig.fitter.trace.not_kept import in_place_of
from rig.fitter.trace.outcome import CONDITIONAL, UNSIGNED
from rig.fitter.trace.search import names_of
from rig.fitter.trace.shares import of_rest, shares, unnamed_part
from rig.procedures.general.effects import TableEffect
from rig.procedures.general.effects.columns import without_side
from rig.procedures.general.effects.of_others import GROUP_GAIN, GROUP_OFFSET
from rig.procedures.general.effects.time_columns import lag, of_start
from rig.procedures.general.swept import all_swept, functions_alike, swept_once
from rig.procedures.general.trace.cross import SHARING, left_out
from rig.procedures.general.trace.estimate import Estimate, estimate, strata_of
from rig.procedures.general.trace.few_plots import few_plots
from rig.procedures.general.trace.few_rows import resting, searched
from rig.procedures.general.trace.findings import CLEAR, memory, noise_findings
from rig.procedures.general.trace.reasons import doubts_of
from rig.procedures.general.trace.remainder import pure_error, unnamed
from rig.procedures.general.trace.result import FoundTableEffect, TableSide, TableTrace
from rig.procedures.general.trace.run import Found, TableData
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth
from rig.procedures.tables.unused import known_unit_of, unit_after

WANDER = "slow-wander"
"""Name of the alias "noise with long memory" of an effect."""
ANOTHER_ORDER = "measure in another order, or up and down: what goes with time then comes elsewhere"
ORDER = "order"
"""Column of the executed position."""
NEAREST = 0.1
"""Largest p of an effect that is told as the nearest to significance, where nothing was found."""
NOT_ASKED = "no rows were left out (--quick): a name with which those are predicted worse is not doubted here"
CONSTANT = 0.99
"""Share of a column between whole plots from which it counts as constant in them."""


def trace_general(data: TableData, *, validate: bool = True) -> TableTrace:
    """Find effects missing in the declared model of a table. Method: docs/explanation/trace.md.

    Args:
        data: the table.
        validate: whether the search is repeated without parts of the rows, for the left-out error. No name and no size
            depends on it, and it takes most of the time.
    """
    looked = searched(data)
    found, data = looked.found, looked.data
    names, apart = data.names, looked.apart if looked.dropped else looked.apart[:0]
    judge, chosen = found.judge, found.chosen
    before, after = (estimate(judge, terms, data.tails, chosen) for terms in ((), chosen))
    crossed = left_out(looked.problem, judge, chosen, apart) if validate else None
    pure = [pure_error(data.y, data.points, _apart_from(judge, terms, apart)) for terms in ((), chosen)]
    unmodelled = UnmodelledSmooth(judge, chosen, data)
    doubts = doubts_of(unmodelled)
    left = unnamed(unmodelled, _variables(data))
    if all(one.stratum == "noise" for one in left):
        left += in_place_of(found.not_kept)
    shown = [_effect(judge, after, name, data) for name in names_of(judge.candidates, chosen)]
    divided = _shares(judge, chosen, shown, unnamed_part(left))
    shape = any(one.stratum != "noise" for one in left)
    resting_names = resting(unmodelled) if looked.apart.size else {}
    sure = any(one.effect not in resting_names for one in shown)
    noise = noise_findings(judge, chosen, found.growth, looked, shape=shape, sure=sure)
    wanders = any(finding.effect == AUTOCORRELATION for finding in noise)
    slow = {c.effect.name for c in judge.candidates if c.effect.source == "time" or ORDER in c.effect.columns}
    wandering = slow if wanders else set()
    assumed = slow if data.scene.time is not None and data.scene.time.presumed else set()
    tried = judge.problem.sensors * sum(len(c.term.labels) for c in judge.candidates)
    cv, words, lost = ((None, None), None, 0) if crossed is None else crossed
    words = data.shares if words == SHARING else words
    rises = cv[0] is not None and cv[1] is not None and cv[1] > cv[0]

    def doubt(effect: FoundTableEffect) -> str | None:
        return (
            _unsettled(effect, data)
            or doubts.get(effect.effect)
            or (not_predicted() if rises else None)
            or _doubt(effect, wandering, tried)
        )

    effects, rest = with_shares(shown, divided, doubt), of_rest(divided, left)
    sides = [
        TableSide(fitted, error, own, strata_of(judge, terms, data.shared), data.shares)
        for fitted, error, own, terms in zip((before, after), cv, pure, ((), chosen), strict=True)
    ]
    doubtful = tuple(effect.effect for effect in effects if effect.doubtful)
    return TableTrace(
        sensor=data.response,
        declared=data.formula,
        names=names,
        verdict=verdict(
            found=bool(effects),
            fell=after.sigma_E < before.sigma_E,
            rest=rest,
            doubtful=bool(doubtful),
            perhaps=any(set(one.aliases) - assumed or one.effect == SLOPES_DIFFER for one in noise),
        ),
        before=sides[0],
        after=sides[1],
        rows=(sides[0].rows(), sides[1].rows()),
        effects=(*effects, *noise),
        unnamed=rest,
        instead=drawn_instead(unmodelled, doubtful),
        fitted=parameters_of(effects, names, after.coefficients, after.stderr, after.dfs),
        notes=(
            *few_plots(found, data),
            *_remarks(found, data, after, {one.effect for one in noise}),
            *(_nearest(judge) if not chosen and not left and not noise else ()),
            *_not_predicted(lost),
            *((CONDITIONAL, UNSIGNED) if effects else ()),
            *((NOT_ASKED,) if effects and not validate else ()),
            *of_left_out(
                cv[0],
                cv[1],
                words or "",
                f"{words} in turn left out, the search repeated without them",
                asked=bool(effects),
            ),
        ),
        y=data.y,
        variables=_variables(data) | _others(data),
        levels={name: g.levels for name, g in data.scene.groups.items()},
        left_out=words,
        search=found,
    )


def _apart_from(judge: TableJudge, terms: tuple[int, ...], apart: IntArray) -> FloatArray:
    """(n, d) columns of effects, and one for each row that is apart."""
    own = np.zeros((judge.problem.n, apart.size))
    own[apart, np.arange(apart.size)] = 1.0
    return np.hstack([judge.problem.of(terms), own])


def _unsettled(effect: FoundTableEffect, data: TableData) -> str | None:
    """Reason for doubt about what depends on times and sides, where a setting still moved while it was read."""
    moved = [name for name in data.moving if name != data.response]
    if not moved or not (effect.dynamic or effect.family == "direction"):
        return None
    return f"{moved[0]} had not settled when it was read, which looks like this"


def _doubt(effect: FoundTableEffect, wandering: Collection[str], tried: int) -> str | None:
    """Reason for doubt about a name that leads every shape without a name, if there is one.

    Args:
        effect: with the name.
        wandering: names of effects that a slow wander may be.
        tried: number of coefficients that were tried, over all sensors.
    """
    if effect.other_causes >= MANY:
        return several_causes(effect.other_causes + 1)
    if effect.effect in wandering and (effect.family != "periodic" or WANDER in effect.aliases):
        return beside_a_wander()  # what came back is no wander
    if effect.p_adjusted_is_bound and beyond_chance(effect.coefficients, effect.given, effect.df, tried):
        return None
    return by_chance(effect.p_adjusted)


def _variables(data: TableData) -> dict[str, FloatArray]:
    scene = data.scene
    time = {} if scene.time is None else {scene.time.name: scene.time.values}
    return {**scene.variables, **time}


def _others(data: TableData) -> dict[str, FloatArray]:
    """Groups, direction and speed as numbers, for plots."""
    scene = data.scene
    parts = dict(part for part in (scene.direction, scene.speed) if part is not None)
    return {name: g.index.astype(np.float64) for name, g in scene.groups.items()} | parts


def _effect(judge: TableJudge, after: Estimate, name: str, data: TableData) -> FoundTableEffect:
    problem, chosen = judge.problem, after.chosen
    mine = [j for j in chosen if judge.candidates[j].effect.name == name]
    effect = judge.candidates[mine[0]].effect
    explanations = judge.rivals(chosen, name)
    best = next(r for r in explanations if r.effect == name)
    alike = [judge.candidates[r.terms[0]].effect for r in explanations if r.alias and r.effect != name]
    spans = _spans(problem.declared.shape[1], judge, chosen)
    picked = [i for j in mine for i in spans[j]]
    labels = tuple(label for j in mine for label in judge.candidates[j].term.labels)
    values, errors = after.coefficients[picked], after.stderr[picked]
    basis = orthonormal(problem.declared)
    # A row whose side, or whose earlier setting, is unknown has a column of its own: no part of the size.
    whole = problem.of(mine) @ np.where([of_start(one) or without_side(one) for one in labels], 0.0, values)
    own = whole - basis @ (basis.T @ whole)
    p = min(judge.p_adjusted(chosen, j) for j in mine)
    experiments = dict.fromkeys((effect.separate_by, *(other.separate_by for other in alike[:2])))
    aliases = tuple(other.name for other in alike)
    separation = {r.effect: round(max(r.sigmas - best.sigmas, 0.0), 2) for r in explanations if r.effect != name}
    ahead = judge.beats_wander(chosen, name)
    if ahead is not None:
        separation[WANDER] = round(float(np.sqrt(max(ahead, 0.0))), 2)
        if ahead <= DELTA:
            aliases = (*aliases, WANDER)
            experiments["go on for as long again: a wander goes elsewhere"] = None
    courses = functions_alike(_over(effect, data), [_over(other, data) for other in alike], _one_course(data))
    if courses:
        experiments[ANOTHER_ORDER] = None
    return FoundTableEffect(
        kind="effect",
        effect=name,
        cause=effect.cause,
        stratum=_stratum(judge, mine, effect.stratum),
        terms=labels,
        coefficients=tuple(values.tolist()),
        stderr=tuple(errors.tolist()),
        unit=effect.unit,
        size=_size(own, whole, values, effect, data.response),
        p_adjusted=p,
        p_adjusted_is_bound=judge.is_bound(p),
        share=0.0,  # together for all effects: `_shares`
        aliases=(*aliases, *courses),
        separation=separation,
        separate_by="; ".join(experiments),
        against=effect.against,
        family=effect.family,
        columns=effect.columns,
        contribution=own,
        other_causes=sum((one.family, one.columns) != (effect.family, effect.columns) for one in alike) + len(courses),
        df=float(np.min(after.dfs[picked])),
        given=tuple(after.given[picked].tolist()),
        dynamic=effect.dynamic,
        constants=tuple(one for j in mine for one in after.constants.get(j, ()) if one.what),
        searched=tuple(
            label
            for term in (judge.candidates[j].term for j in mine)
            for label in term.labels
            if term.profile is not None and not term.profile.what
        ),
        time_unit="" if data.scene.time is None else known_unit_of(data.scene.time.name),
    )


def _one_course(data: TableData) -> tuple[str, ...]:
    """Time and the variables that only rise or only fall with it; empty without such a variable."""
    scene = data.scene
    if scene.time is None or scene.time.presumed:
        return ()
    found = all_swept(scene.variables, scene.time.values)
    return (scene.time.name, *found) if found else ()


def _over(effect: TableEffect, data: TableData) -> tuple[str, ...]:
    """Columns of an effect; those of one of time alone have that of time."""
    time = data.scene.time
    return (*effect.columns, *([time.name] if effect.source == "time" and time is not None else ()))


def _size(own: FloatArray, whole: FloatArray, values: FloatArray, effect: TableEffect, response: str) -> str:
    """Size of an effect beyond the declared model; for levels of a group the range of their coefficients, for the side
    of approach how far it goes to either side, since what the declared model takes up of it moves the ends.
    """
    unit = unit_after(response)
    of = "" if unit else f", in the unit of {response}"
    rms, ends = f"{np.sqrt(np.mean(own**2)):.3g}{unit} rms", f"{np.ptp(own):.3g}{unit} from end to end{of}"
    apart = np.ptp(np.concatenate([[0.0], values]))
    if effect.kind is GROUP_OFFSET:
        return f"{rms}, levels up to {apart:.3g}{unit} apart{of}"
    if effect.kind is GROUP_GAIN:
        return f"{rms}, {ends}; slopes up to {apart:.3g} {effect.unit} apart"
    if effect.family == "direction":
        return f"{rms}, up to {np.max(np.abs(whole)):.3g}{unit} to either side{of}"
    return f"{rms}, {ends}"


def _spans(declared: int, judge: TableJudge, chosen: tuple[int, ...]) -> dict[int, range]:
    """Position of the coefficients of each candidate."""
    spans, start = {}, declared
    for j in chosen:
        width = judge.candidates[j].term.columns.shape[1]
        spans[j] = range(start, start + width)
        start += width
    return spans


def _stratum(judge: TableJudge, mine: list[int], usual: str) -> str:
    noise = judge.problem.noise
    if not isinstance(noise, Shared | Components):
        return usual
    columns = judge.problem.of(mine) - judge.problem.of(mine).mean(axis=0)
    sums = np.zeros((int(noise.group.max()) + 1, columns.shape[1]))
    np.add.at(sums, noise.group, columns)
    between = float(np.sum(sums**2 / np.bincount(noise.group)[:, None]))
    return "whole-plot" if between > CONSTANT * float(np.sum(columns**2)) else "subplot"


def _shares(
    judge: TableJudge, chosen: tuple[int, ...], effects: Sequence[FoundTableEffect], unnamed: float
) -> FloatArray:
    """Share of each effect in the response beyond scatter, with rows weighted by the estimated scatter.

    Args:
        judge: of the table.
        chosen: candidates in the model.
        effects: the estimated ones.
        unnamed: part of the remainder that is not scatter.
    """
    view, white = judge.view(0), judge.white(0, chosen)
    taken = view.taken(chosen)
    left = white - taken @ (taken.T @ white)
    df = len(white) - view.basis.shape[1]
    variance = float(left @ left) / max(len(white) - taken.shape[1], 1)
    parts = [effect.contribution / judge.problem.sd for effect in effects]
    beyond = [part - view.basis @ (view.basis.T @ part) for part in parts]
    residual = white - view.basis @ (view.basis.T @ white)
    return shares(beyond, residual, df * variance * (1.0 - unnamed))


def _nearest(judge: TableJudge) -> Iterator[str]:
    """The effect nearest to significance in a table in which nothing was found."""
    few = judge.problem.n < SIMULATED  # beyond, p of what is not near enough is not known without a simulation
    for name, p in judge.suspects((), NEAREST)[:1] if few else ():
        yield f"nearest to an effect comes {name}, p = {p:.2g} over all that are tried: below {ALPHA:g} it is found"


def _not_predicted(rows: int) -> Iterator[str]:
    if rows:
        yield (
            f"cv_rms is without {rows} {'row' if rows == 1 else 'rows'} at the begin of a session: no row of another "
            "group determines what was remembered there of settings before"
        )


def _remarks(found: Found, data: TableData, after: Estimate, told: Collection[str]) -> tuple[str, ...]:
    judge, remarks = found.judge, [one.sentence for one in found.not_kept]
    time, *courses = _one_course(data) or ("",)
    remarks += [swept_once(name, time) for name in courses]
    noise, at = judge.problem.noise, judge.beside(found.chosen).best
    if found.growth is not None:
        remarks.append("rows were weighted by the scatter found; sigma_E uses equal weights")
    correlation, p = memory(judge, found.chosen, data.sensors)
    if correlation > 0:
        kind = "a random walk" if correlation == 1.0 else f"a correlation of {correlation:.2f}"
        how = "are not independent" if p <= CLEAR else f"may not be independent (p = {p:.2g} by chance)"
        remarks.append(f"neighbouring rows {how}: effects were judged against {kind}")
    if isinstance(noise, Components) and noise.grid[at, 1] > 0.0 and SLOPES_DIFFER not in told:
        remarks.append(f"{data.shares} may differ in their slope too: effects were judged beside that")
    if isinstance(noise, Components) and noise.grid[at, 2] > 0.0:
        remarks.append(
            f"neighbouring rows in {data.shares} are not independent: effects were judged against a correlation of "
            f"{noise.grid[at, 2]:.2f}"
        )
    remarks += data.moving.values()
    lags = [one for one in (judge.candidates[j].effect for j in found.chosen) if one.kind.terms is lag]
    remarks += [
        f"{one.name}: when {one.columns[0]} was set is not known; it is taken to change evenly from row to row. "
        f"Intervals leave that out: after steps, size and constant of a lag are further off"
        for one in lags
        if one.columns[0] in data.scene.settings and data.scene.stood(one.columns[0]) is None
    ]
    remarks += [
        f"{name}: the interval of its size takes its searched constant as found: these rows give it no error"
        for name in after.taken
    ]
    return tuple(dict.fromkeys(remarks))
