"""Findings, combined by transducer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scipy.special import chdtrc

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, NOISE_GROWS, OUTLIERS, SLOPES_DIFFER
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import separation
from rig.fitter.trace.drawn import drawn, drawn_instead, drawn_period
from rig.fitter.trace.engine.beside import LEVELS, Level
from rig.fitter.trace.found import CONFIRMED, experiments, of_left_out, parameters_of, verdict, with_shares
from rig.fitter.trace.growing_noise import Noise
from rig.fitter.trace.lines import CLEAR
from rig.fitter.trace.not_kept import for_others
from rig.fitter.trace.outcome import CONDITIONAL, Finding, remains
from rig.fitter.trace.shares import of_rest, shares, unnamed_part
from rig.procedures.pressure.effects.scene import PressureEffect, PressureTerm
from rig.procedures.pressure.effects.separation import separate_pressure
from rig.procedures.pressure.trace.estimate import Estimate, error_of, rises
from rig.procedures.pressure.trace.noise_report import noise_findings
from rig.procedures.pressure.trace.reasons import UNEXPLAINED, Run, doubt
from rig.procedures.pressure.trace.remainder import reading_error_pct
from rig.procedures.pressure.trace.result import FoundPressureEffect, Side, TransducerTrace
from rig.procedures.pressure.trace.some_plots import in_some_plots
from rig.procedures.pressure.trace.time_constants import time_constant

DIFFERENT = 0.01
"""Coefficients of all transducers that agree with more than this probability are called equal."""

LEFT_TO_PLOTS = (
    "the errors after have only the part within whole plots of what was found there: its part between them happens to "
    "raise the error between whole plots, and is left to it"
)
RISES = (
    "the error of all whole plots and readings together is above that before: what was found lowers the error of its "
    "own stratum, or of other transducers"
)
LEAVING_OUT = "each whole plot in turn left out of selection and fit, its error predicted as zero"


def transducer(run: Run, i: int) -> TransducerTrace:
    """Findings in transducer `i`."""
    sensor = run.judge.problem.sensors[i]
    left = _unnamed(run, i)
    shown = [e for name in run.classes if (e := _found(run, name, i)) is not None]
    divided = _shares(run, [effect.effect for effect in shown], unnamed_part(left), i)
    effects = (
        *with_shares(shown, divided, lambda effect: doubt(run, effect, i)),
        *noise_findings(run, i),
    )
    rest = of_rest(divided, left)
    idle = [effect.effect for effect in effects if not _falls(run, effect, i)]
    before, after = _side(run, run.before, i, 0), _side(run, run.stated, i, 1)
    fit = after.fit
    refused = tuple(one for one in run.refused if sensor in one.sensors)
    added = tuple(effect for effect in effects if effect.kind == "effect")
    return TransducerTrace(
        sensor=sensor,
        declared=run.model,
        verdict=verdict(
            found=bool(added),
            fell=not idle,
            rest=rest,
            doubtful=any(effect.doubtful for effect in effects),
            perhaps=any(effect.effect == SLOPES_DIFFER for effect in effects),
        ),
        before=before,
        after=after,
        rows=(before.rows(), after.rows()),
        effects=effects,
        unnamed=rest,
        instead=drawn_instead(run.unmodelled[i], tuple(effect.effect for effect in effects if effect.doubtful)),
        refused=refused,
        fitted=parameters_of(added, fit.names, after.declared, fit.kenward_roger().stderr, fit.df),
        notes=(
            *after.fit.notes,
            *(text for name in run.classes for text in (_alike(run, name), _mixed(run, name)) if text),
            *(one.sentence for one in run.settled.not_kept if one.sensor in (None, sensor)),
            *map(for_others, idle),
            *([LEFT_TO_PLOTS] if run.stated.fits[i] is not run.after.fits[i] else []),
            *([RISES] if rises(run.before, run.stated, i) else []),
            *(one.sentence for one in refused),
            *_notes(run, before, after, effects, i),
        ),
        noise_within=run.settled.noise[i] or Noise(fit.sigma_subplot, 0.0, (0.0, 0.0), 1.0),
        sensitivity=run.scene.sensitivity[sensor],
    )


def _notes(run: Run, before: Side, after: Side, effects: Sequence[FoundPressureEffect], i: int) -> Iterator[str]:
    """Sentences about the noise, and on what the effects rest."""
    named = {effect.effect for effect in effects}
    if NOISE_GROWS in named:
        where, wide, narrow = ("with pressure", "at low pressure", "at high")
        if (noise := run.settled.noise[i]) is not None and noise.middle is not None:
            where, wide, narrow = ("towards both ends of the pressures", "in the middle", "at the ends")
        yield (
            f"noise grows {where}: intervals that take one sd for all pressures are too wide {wide} and too narrow "
            f"{narrow}; readings were weighted by it here"
        )
    if AUTOCORRELATION in named:
        yield (
            "successive readings' errors are alike: intervals that take them for independent are too narrow for "
            "what changes slowly within whole plots; effects were judged beside that here"
        )
    if OUTLIERS in named:
        yield "readings that stand out count as three standard deviations here, before and after; they are listed"
    between = any(effect.stratum == "whole-plot" for effect in effects)
    if between:
        count = len(after.fit.whole_plots)
        yield f"effects between whole plots were judged on {count} numbers, one a whole plot"
    added = any(effect.kind == "effect" for effect in effects)
    if added:
        yield CONDITIONAL
    most = CONFIRMED if between else 1.0  # errors of whole plots hide what is within them
    yield from of_left_out(before.cv_rms, after.cv_rms, "whole plots", LEAVING_OUT, most, asked=added)


def _side(run: Run, fitted: Estimate, i: int, when: int) -> Side:
    fit, formula = fitted.fits[i], run.formula
    if formula.has_categories or "P" not in formula.names:
        slope = np.full(len(run.data), run.scene.sensitivity[run.judge.problem.sensors[i]])
    else:
        slope = formula.derivative(run.data.table, "P") @ fit.coefficients[: len(formula.terms)]
    return Side(
        fit=fit,
        declared=fitted.declared[i],
        reading_error_pct=reading_error_pct(run.data, fitted.residual[i], slope),
        cv_rms=None if run.cv is None else float(run.cv[when, i]),
        residual_mV=fitted.residual[i],
    )


def _found(run: Run, name: str, i: int) -> FoundPressureEffect | None:
    """The effect in transducer `i`; None if it does not concern it."""
    problem, after, explanations = run.judge.problem, run.after, run.classes[name]
    sensor = problem.sensors[i]
    mine = [
        j
        for j in after.chosen
        if problem.candidates[j].effect.name == name and problem.candidates[j].sensor in (None, sensor)
    ]
    if not mine:
        return None
    effect, level = problem.candidates[mine[0]].effect, problem.judged_at[mine[0]]
    coefficients = {problem.candidates[j].term.name: after.coefficients[j] for j in mine}
    values = np.array([c.value for c in coefficients.values()])
    contribution = problem.raw[i][:, mine] @ values
    p = min(run.judge.p_adjusted(after.chosen, j) for j in mine)
    alike = [problem.candidates[r.terms[0]].effect for r in explanations if r.alias and r.effect != name]
    basis = orthonormal(problem.declared)
    peak = float(np.max(np.abs(contribution - basis @ (basis.T @ contribution))))
    further = experiments(effect, alike, separate_pressure)
    psi = peak / abs(run.scene.sensitivity[sensor])
    return FoundPressureEffect(
        kind="noise" if effect.of_noise else "effect",
        effect=name,
        cause=effect.cause,
        stratum="noise" if effect.of_noise else level,
        terms=tuple(coefficients),
        coefficients=tuple(c.value for c in coefficients.values()),
        stderr=tuple(c.stderr for c in coefficients.values()),
        unit=_unit(effect, [problem.candidates[j].term for j in mine]),
        size=effect.size(
            {term: c.value for term, c in coefficients.items()},
            run.scene.sensitivity[sensor],
            {term: c.stderr for term, c in coefficients.items()},
        ),
        p_adjusted=p,
        p_adjusted_is_bound=run.judge.is_bound(p),
        share=0.0,  # together for all effects: `_shares`
        aliases=tuple(other.name for other in alike),
        separation=separation(explanations, name),
        separate_by=f"{further}; {peak:.2g} mV ({psi:.2g} psi) of it are left beside the model",
        against=effect.against,
        formulas=tuple(filter(None, (problem.candidates[j].term.formula for j in mine))),
        df=tuple(c.df for c in coefficients.values()),
        half_width_95=tuple(c.half_width_95 for c in coefficients.values()),
        contribution_mV=contribution,
        peak_mV=peak,
        peak_psi=psi,
        constants=tuple(time_constant(run.unmodelled, name)),
    )


def _unit(effect: PressureEffect, terms: Iterable[PressureTerm]) -> str:
    """Unit of the coefficients: one for all of them, or one each, as displayed."""
    units = [term.unit or effect.unit for term in terms]
    return ", ".join(units if len(set(units)) > 1 else units[:1])


def _falls(run: Run, effect: FoundPressureEffect, i: int) -> bool:
    """Whether the error of the effect's stratum is smaller with all effects; also true for findings about noise."""
    if effect.kind == "noise":
        return True
    level: Level = "whole-plot" if effect.stratum == "whole-plot" else "subplot"
    return error_of(run.after, level, i) < error_of(run.before, level, i)


def _shares(run: Run, names: list[str], unnamed: float, i: int) -> FloatArray:
    """Share of each effect in the variation of both strata beyond their errors, in mV^2 with equal weight of readings.

    Args:
        run: of the run.
        names: of the effects.
        unnamed: part of the remainder that is not scatter.
        i: the transducer.
    """
    problem, after = run.judge.problem, run.after
    sensor, effects = problem.sensors[i], problem.candidates
    mine = [
        [j for j in after.chosen if effects[j].effect.name == n and effects[j].sensor in (None, sensor)] for n in names
    ]
    parts = [problem.raw[i][:, own] @ np.array([after.coefficients[j].value for j in own]) for own in mine]
    every, basis = np.column_stack([*parts, run.judge.held(after.chosen)[i]]), orthonormal(problem.model)
    every = every - basis @ (basis.T @ every)
    left = every[:, -1] - every[:, :-1].sum(axis=1)
    count = np.bincount(problem.whole_plot)
    between = (np.bincount(problem.whole_plot, left) / count)[problem.whole_plot]
    scatter = 0.0
    levels: dict[Level, FloatArray] = {"subplot": left - between, "whole-plot": between}
    for level, rows in levels.items():
        used, df = sum(problem.judged_at[own[0]] == level for own in mine if own), run.free(level, i)
        scatter += float(rows @ rows) * (1.0 - unnamed) * df / max(df - used, 1.0)
    *beyond, residual = every.T
    return shares(beyond, residual, scatter)


def _alike(run: Run, name: str) -> str:
    """Note on an effect of each transducer that is equal in all of them."""
    problem, after = run.judge.problem, run.after
    mine = [j for j in after.chosen if problem.candidates[j].effect.name == name]
    owners = [problem.candidates[j].sensor for j in mine]
    terms = {problem.candidates[j].term.name for j in mine}
    if len(problem.sensors) < 2 or len(terms) > 1 or set(owners) != set(problem.sensors):
        return ""
    per_psi = np.array([run.scene.sensitivity[str(owner)] for owner in owners])
    value = np.array([after.coefficients[j].value for j in mine]) / per_psi
    weight = (per_psi / np.array([after.coefficients[j].stderr for j in mine])) ** 2
    mean = float(value @ weight / weight.sum())
    if chdtrc(len(mine) - 1, float(weight @ (value - mean) ** 2)) < DIFFERENT:
        return ""
    return (
        f"{name} is the same in all {len(mine)} transducers, {mean:.3g} psi for one of {terms.pop()}: an error of the "
        "pressure reference would look like that; have the controller checked, or read a second gauge on the line"
    )


def _mixed(run: Run, name: str) -> str:
    """Transducers that need a separate effect, for a line to explain the effect in all of them."""
    every = run.judge.problem.candidates
    for rival in run.classes[name]:
        own = [every[j] for j in rival.terms if every[j].effect.name != rival.effect]
        if rival.alias and rival.effect != name and own:
            where = ", ".join(dict.fromkeys(str(candidate.sensor) for candidate in own))
            return f"{rival.effect} explains as much as {name} only with {own[0].effect.name} in {where} besides"
    return ""


def _unnamed(run: Run, i: int) -> tuple[Finding, ...]:
    """The remainder in both strata beyond chance: the shape it follows, and a period."""
    unmodelled = run.unmodelled[i]
    rest: list[Finding] = []
    for level in LEVELS[::-1]:
        left = unmodelled.left_in(0, level)
        if left is not None and left.p < UNEXPLAINED:
            rest.append(remains(left.where, left.remainder.share, shape=drawn(unmodelled, left)))
        elif level == "whole-plot" and i in run.courses:
            rest.append(run.courses[i].unnamed())
    line = unmodelled.line
    if line is not None and line.p < CLEAR:
        rest.append(remains(line.where, line.share, shape=drawn_period(unmodelled, line)))
    if unmodelled.able and all(one.stratum == "noise" for one in rest):
        some = in_some_plots(unmodelled)
        rest += [] if some is None else [some]
    return tuple(rest)
