"""Judgement of the explanations of an effect by a run that was not used to name it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.compare import Comparison, fitted_again, lasting, nuisance
from rig.fitter.confirm.constants import Sizes, around, sizes_alone, with_constants
from rig.fitter.confirm.minor_causes import MinorCause, minor_causes
from rig.fitter.confirm.prediction import SensorError, prediction_errors
from rig.fitter.confirm.question import Hypothesis, Question
from rig.fitter.confirm.structure import structured
from rig.fitter.confirm.together import Candidates, Together, left, solve
from rig.fitter.effects.sizes import arcsec, size_with_95
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import DISTINGUISHED, f_tail, t_limit

ROUNDS = 5
STANDS_OUT, MOST_OUTLIERS = 6.0, 0.02
MISFIT = 1.5
"""Mean square of residuals relative to the error's above which a model does not fit, if the excess is significant."""
CHANGED = 1e-3
"""Probability below which an explanation fails: its sizes in the two runs differ."""
PREDICTED = 0.1
"""Part of a dynamic effect, rms, that its sizes in the first run may leave of it in the later one. Its columns take
settings for steps and readings for moments, so a run of another order or other hold times gives it another size."""


BY_BOTH = ", by both runs"
"""Behind a size that is that of both runs."""
APART = 1.7
"""Half-widths of a 95 % interval by which two runs' sizes differ: 3.3 standard errors, as by `CHANGED`."""
Returns = Literal["shown", "other size", "absent", "unknown"]
"""Answers of a run about an effect of another."""


@dataclass(frozen=True, eq=False)
class Member:
    """One explanation after the later run.

    Attributes:
        effect: name in the catalogue; of several causes together their names.
        causes: names of its causes.
        sigmas: standard errors by which it is worse than the best, all runs together.
        p_changed: probability of such a difference between its sizes in the two runs if it is the cause.
        shown: standard errors by which the later run shows it.
        expected: the same if it is as large as in the first run: below the limit that run cannot tell.
        p_shown: probability of `shown` or more by chance without it in the later run; an upper bound.
        limit: standard errors that separate two explanations, and one from none: three, or more if the error is known
            with few degrees of freedom only.
        missed: of a dynamic effect, what its sizes in the first run and error leave of it in the later run, as a part
            of what it is there, rms; infinite for others.
        fits: whether its residuals in the later run are no more than error, and follow no smooth curve.
        p_fits: probability by chance of such residuals, or of such a curve in them; a model does not fit below 1e-3.
        place: of that curve, if it does not fit: "over flow_kg_per_min"; "" if its residuals are too large altogether.
        terms: names of its terms.
        coefficients: of the terms, from the later run alone, so without selection bias; of `shifts` the constants.
        intervals: 95 % intervals of them.
        together: coefficients from both runs.
        intervals_together: 95 % intervals of these.
        sizes: sizes of the cause by the later run alone, in physical terms, by sensor; with its interval for a single
            term: "5.0e-4 deg/g (4.1e-4 deg/g to 5.9e-4 deg/g)". Empty if that run does not determine them. With a
            searched constant those by both runs, and the text says so: one run seldom tells it from the size.
        against: field of the data for a plot of its residual.
        shifts: names of terms that are searched constants.
        before: coefficients from the first run alone.
        intervals_before: 95 % intervals of these.
    """

    effect: str
    causes: tuple[str, ...]
    sigmas: float
    p_changed: float
    shown: float
    expected: float
    p_shown: float
    limit: float
    missed: float
    fits: bool
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    intervals: tuple[tuple[float, float], ...]
    together: tuple[float, ...]
    intervals_together: tuple[tuple[float, float], ...]
    sizes: Mapping[str, str]
    against: str
    shifts: frozenset[str] = frozenset()
    p_fits: float = 1.0
    place: str = ""
    before: tuple[float, ...] = ()
    intervals_before: tuple[tuple[float, float], ...] = ()

    @property
    def returns(self) -> Returns:
        """Answer of the later run by itself about the effect of the first: nothing joins the days.

        "shown" with the same size, "other size"; "absent" where its interval contains zero, and the size of the first
        run is far outside; "unknown" where it contains both, or has no end, as with a searched constant.
        """
        every = zip(self.before, self.intervals_before, self.coefficients, self.intervals, strict=True)
        ended = [(a, c - a, b, d - b) for a, (_, c), b, (_, d) in every if np.isfinite([a, b, c, d]).all()]
        same = all(abs(b - a) <= APART * np.hypot(own, other) for a, own, b, other in ended)
        if any(abs(b) > other for _, _, b, other in ended):
            return "shown" if same else "other size"
        return "unknown" if same else "absent"

    @property
    def zero(self) -> tuple[str, ...]:
        """Names of the terms, but `shifts`, whose interval by the later run alone contains zero, or is undetermined."""
        every = zip(self.terms, self.intervals, strict=True)
        return tuple(name for name, (low, high) in every if not (low > 0 or high < 0) and name not in self.shifts)

    @property
    def seen(self) -> bool:
        """Whether the later run distinguishes it from zero, and both runs together give a size other than zero."""
        every = zip(self.terms, self.intervals_together, strict=True)
        return self.shown >= self.limit and any(
            (low > 0 or high < 0) and name not in self.shifts for name, (low, high) in every
        )

    @property
    def holds(self) -> bool:
        """Whether it is not rejected: not worse than another, and of the same size in both runs and a good fit; or it
        is dynamic, and the first run predicts the later one nearly.
        """
        same = self.p_changed >= CHANGED and self.fits
        return self.sigmas <= self.limit and (same or self.missed <= PREDICTED)


@dataclass(frozen=True, eq=False)
class Confirmation:
    """Result for one question.

    Attributes:
        effect: effect named by the trace.
        members: its explanations, the best first.
        holder: terms of the best explanation, if it excludes the named one; empty otherwise.
        outliers: readings of the later run that are outliers under every explanation and were left out, by their
            position in that run.
        beside: causes of its class that may be there beside the explanation that holds.
        question: as it was judged, with the confirmed explanations of the others in its rest.
        used_up: of the later run, the number of groups of readings with a common error, if the declared model, fitted
            again in it, leaves no degrees of freedom between them; 0 otherwise.
    """

    effect: str
    members: tuple[Member, ...]
    outliers: tuple[int, ...] = ()
    holder: tuple[Any, ...] = ()
    minor_causes: tuple[MinorCause, ...] = ()
    question: Question | None = None
    used_up: int = 0

    @property
    def holding(self) -> tuple[str, ...]:
        """Explanations that are not rejected."""
        return tuple(member.effect for member in self.members if member.holds)

    @property
    def verdict(self) -> str:
        """One of "confirmed", "replaced" by another member, "undecided" between several, "not shown", "none holds".

        Not shown: one explanation holds, but the later run does not distinguish it from zero.
        """
        if not self.holding:
            return "none holds"
        if len(self.holding) > 1:
            return "undecided"
        if not self.members[0].seen:
            return "not shown"
        return "confirmed" if self.holding == (self.effect,) else "replaced"

    @property
    def cannot_tell(self) -> bool:
        """Whether it is not shown, or undecided, because the later run would show no explanation that holds.

        That is, not even if it is as large as in the first run.
        """
        unsettled = self.verdict in ("not shown", "undecided")
        return unsettled and all(m.expected < m.limit for m in self.members if m.holds)


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Results for all questions.

    Attributes:
        answers: one per question.
        errors: of predicting the later run without and with the effects (the confirmed ones in place of the named
            ones), by sensor.
        adds: (m,) contribution of each answer's effect to the readings of the later run, by its name and sensor.
        kept: (m,) positions of these readings in the later run, without outliers.
        realigned: whether the later run was predicted with its own offsets and sensitive axes, because the package was
            mounted again or the first run does not determine them; otherwise with those of the first run.
    """

    answers: tuple[Confirmation, ...]
    errors: Mapping[str, SensorError]
    adds: Mapping[tuple[str, str], FloatArray]
    kept: NDArray[np.int64]
    realigned: bool


def confirm_all(both: Together, questions: Sequence[Question]) -> Confirmed:
    """Judge all questions, each with the confirmed explanations of the others in the model.

    If another explanation excludes the named one, the others are judged again with it, also if it does not hold yet:
    what it leaves may be due to a wrong one of the others.
    """
    holders = {q.effect: q.terms for q in questions}
    answers: tuple[Confirmation, ...] = ()
    for _ in range(ROUNDS):
        answers = tuple(
            confirm(both, replace(q, rest=tuple(t for name, own in holders.items() if name != q.effect for t in own)))
            for q in questions
        )
        now = {q.effect: answer.holder or q.terms for q, answer in zip(questions, answers, strict=True)}
        settled = all(now[name] == own for name, own in holders.items())
        holders = now
        if settled:
            break
    aside = {row for answer in answers for row in answer.outliers}
    start = int(np.flatnonzero(both.fresh)[0])
    kept = np.array([k for k in range(int(both.fresh.sum())) if k not in aside], np.int64)
    rows = ~both.fresh
    rows[start + kept] = True
    both = both.only(rows)
    errors, adds = prediction_errors(both, holders)
    return Confirmed(answers, errors, adds, kept, both.realigned)


def confirm(both: Together, question: Question) -> Confirmation:
    """Judge the members of one question by both runs together, and by the later one alone."""
    both, question = both.about(question)
    standing_out = _outliers(both, question)
    aside = tuple((standing_out - int(np.flatnonzero(both.fresh)[0])).tolist())
    if aside:
        kept = np.ones(both.fresh.size, np.bool_)
        kept[standing_out] = False
        both = both.only(kept)
    comparison = Comparison(both, question)
    told = comparison.apart(both.outputs[:, None])
    together = _with_pair(both, question, ties.lowest(told.behind[:, 0]))
    if together is not None:
        question = together
        comparison = Comparison(both, question)
        told = comparison.apart(both.outputs[:, None])
    members = [
        _member(comparison, j, float(behind), float(shown))
        for j, (behind, shown) in enumerate(zip(told.behind[:, 0], told.shown[:, 0], strict=True))
    ]
    members.sort(key=lambda member: len(member.terms))
    members = ties.ordered(members, key=lambda member: member.sigmas**2, unit=1.0)
    nearest = members[0]
    members.sort(key=lambda member: not member.holds)
    used_up = both.used_up if fitted_again(both, question) else 0
    answer = Confirmation(question.effect, tuple(members), aside, question=question, used_up=used_up)
    names = [member.effect for member in question.members]
    best = members[0] if answer.holding else nearest
    named = next(member for member in members if member.effect == question.effect)
    if best is not named and (answer.verdict == "replaced" or named.sigmas > named.limit):
        answer = replace(answer, holder=question.members[names.index(best.effect)].terms)
    if answer.verdict not in ("confirmed", "replaced"):
        return answer
    return replace(answer, minor_causes=minor_causes(comparison, names.index(answer.holding[0])))


def _with_pair(both: Together, question: Question, best: int) -> Question | None:
    """The question with the best single explanation and another one together, if a single one is clearly not enough.

    None if no pair is better than all single explanations by what separates two.
    """
    if len(question.members) < 2:
        return None
    one = question.members[best]
    pairs = tuple(one.beside(other) for other in question.members if not one.has(other) and not other.has(one))
    if not pairs:
        return None
    tried = replace(question, members=(one, *pairs))
    costs = Comparison(both, tried).apart(both.outputs[:, None]).costs[:, 0]
    at = ties.lowest(costs)
    if at == 0 or costs[0] - costs[at] <= t_limit(DISTINGUISHED, both.df) ** 2:
        return None
    return replace(question, members=(*question.members, tried.members[at]))


def _misfit(both: Together, model: FloatArray) -> tuple[float, float]:
    """Mean square of a model's residuals in the later run over the error's, and its degrees of freedom."""
    fresh = np.tile(both.fresh, len(both.sensors))
    rest = left(model, both.outputs)[fresh]
    df = rest.size - float(np.sum(orthonormal(model)[fresh] ** 2)) - both.leverage(both.fresh)
    return (float(np.sum(rest**2) / df), df) if df >= 1.0 else (1.0, 1.0)


def _outliers(both: Together, question: Question) -> NDArray[np.int64]:
    """Rows of the later run whose residual exceeds `STANDS_OUT` in a sensor under every member.

    They are removed one by one, the worst first, since it affects the fit of the rest. More than `MOST_OUTLIERS` of
    them are not outliers, but an effect that no member explains.
    """
    most = max(int(MOST_OUTLIERS * np.sum(both.fresh)), 2)
    whole, rows = both.fresh.size, np.arange(both.fresh.size)
    for _ in range(most + 1):
        worst = np.where(both.fresh, np.min([_standing(both, question, m.terms) for m in question.members], 0), 0.0)
        if worst.max() <= STANDS_OUT:
            return np.setdiff1d(np.arange(whole), rows)
        kept = np.arange(rows.size) != ties.highest(worst)
        both, rows = both.only(kept), rows[kept]
    return rows[:0]


def _standing(both: Together, question: Question, terms: Candidates) -> FloatArray:
    """(n,) largest residual over all sensors with these effects, in standard deviations."""
    model = np.column_stack([both.all_columns_of([*terms, *question.rest]), nuisance(both, question)])
    return np.asarray(np.max(np.abs(left(model, both.outputs).reshape(len(both.sensors), -1)), axis=0))


def _member(comparison: Comparison, j: int, sigmas: float, shown: float) -> Member:
    both, question = comparison.both, comparison.question
    member, own, model = question.members[j], comparison.own[j], comparison.models[j]
    again = nuisance(both, question)
    shifts = both.shifts if not again.shape[1] and not both.realigned else again[:, :0]
    q = own.shape[1]
    together, spread = solve(model, both.outputs)[:q], _errors_of(model)[:q]
    changed = both.columns_in(member.terms, both.fresh)
    gain, more = _gained(both.outputs, model, np.column_stack([changed, shifts]))
    df, limit = both.df, member.limit(both.df)
    fits, p_fits, place = _fits(both, model)
    if fits and sigmas <= limit:
        p_fits, place = structured(both, model, lasting=lasting(question))
        fits = p_fits >= CHANGED
    p = f_tail(gain / more, more, df) if more > 0 else 1.0
    later, t = both.only(both.fresh), t_limit(0.95, df)
    found = sizes_alone(later, member, question.rest, t)
    before = sizes_alone(both.only(~both.fresh), member, question.rest, t)
    in_both = with_constants(both, member, comparison.rest, Sizes(together, around(together, spread, t)), t)
    sensors = ("" if term.sensor is None else f" ({term.sensor})" for term in member.terms)
    names = [
        found.names.get(k, term.term.name) + sensor
        for k, (term, sensor) in enumerate(zip(member.terms, sensors, strict=True))
    ]
    return Member(
        effect=member.effect,
        causes=member.causes,
        sigmas=sigmas,
        p_changed=float(p),
        shown=shown,
        expected=comparison.expected(j),
        p_shown=float(f_tail(shown**2 / q, q, df)),
        limit=limit,
        missed=_missed(both, model, changed, shifts) if all(t.effect.dynamic for t in member.terms) else np.inf,
        fits=fits,
        p_fits=p_fits,
        place="" if fits else place,
        terms=tuple(names),
        coefficients=tuple(found.values.tolist()),
        intervals=found.intervals,
        together=tuple(in_both.values.tolist()),
        intervals_together=in_both.intervals,
        sizes=_sizes(both, member, in_both if in_both.constants else found),
        against=member.terms[0].effect.against,
        shifts=frozenset(name for name, t in zip(names, member.terms, strict=True) if getattr(t, "slope", ())),
        before=tuple(before.values.tolist()),
        intervals_before=before.intervals,
    )


def _missed(both: Together, model: FloatArray, changed: FloatArray, shifts: FloatArray) -> float:
    """`Member.missed`: what sizes in the first run and error leave of a dynamic effect in the later run, a share of it.

    Args:
        both: the runs.
        model: (n, k) columns of an effect in both runs, then all others.
        changed: (n, q) those of the effect in the later run.
        shifts: (n, l) offsets of the later run.
    """
    q = changed.shape[1]
    full = np.column_stack([model, changed, shifts])
    sizes = solve(full, both.outputs)
    before, more = sizes[:q], sizes[model.shape[1] : model.shape[1] + q]
    taken = orthonormal(np.column_stack([model[:, q:], shifts]))
    shape = changed - taken @ (taken.T @ changed)
    misfit, df = _misfit(both, full)
    whole = float(np.sum((shape @ (before + more)) ** 2))
    missed = float(np.sum((shape @ more) ** 2)) + max(misfit - 1.0, 0.0) * df
    return float(np.sqrt(missed / whole)) if whole > 0.0 else np.inf


def _errors_of(model: FloatArray) -> FloatArray:
    """(q,) standard errors of coefficients of columns (n, q) in units of the error; NaN for a zero column."""
    length = np.linalg.norm(model, axis=0)
    scale = np.where(length > 0, length, 1.0)
    errors = np.linalg.norm(np.linalg.pinv(model / scale, rcond=1e-8) / scale[:, None], axis=1)
    return np.asarray(np.where(length > 0, errors, np.nan))


def _fits(both: Together, model: FloatArray) -> tuple[bool, float, str]:
    """Whether a model's residuals in the later run are as large as the error, the probability, and no place."""
    misfit, df = _misfit(both, model)
    p = float(f_tail(misfit, df, both.df))
    return misfit < MISFIT or p > CHANGED, p, ""


def _sizes(both: Together, member: Hypothesis, found: Sizes) -> dict[str, str]:
    """Size of a member in each sensor, by the later run alone; with its 95 % interval in brackets."""
    out: dict[str, list[str]] = {}
    alone, intervals = found.values, found.intervals
    causes = dict.fromkeys(term.effect.name for term in member.terms)
    for (sensor, slope), cause in itertools.product(zip(both.sensors, both.slope.tolist(), strict=True), causes):
        of_cause = [k for k, term in enumerate(member.terms) if term.effect.name == cause]
        mine = [k for k in of_cause if member.terms[k].sensor in (None, sensor)]
        constants = [found.constants[k] for k in mine if k in found.constants]
        mine = [k for k in mine if k not in found.constants]
        if not mine or not np.all(np.isfinite(alone[mine])):
            continue
        effect = member.terms[mine[0]].effect
        size = arcsec if len(mine) == 1 and effect.size.phases else effect.size  # a single phase has a sign
        names = [member.terms[k].term.name for k in mine]
        values = dict(zip(names, alone[mine].tolist(), strict=True))
        ends = {name: intervals[k] for name, k in zip(names, mine, strict=True)}
        text = ", ".join([size_with_95(size, values, ends, slope), *constants]) + (BY_BOTH if constants else "")
        out.setdefault(sensor, []).append(f"{cause} {text}" if len(causes) > 1 else text)
    return {sensor: "; ".join(texts) for sensor, texts in out.items()}


def _gained(outputs: FloatArray, model: FloatArray, further: FloatArray) -> tuple[float, int]:
    """Fall of the sum of squares by further columns (n, q) beside a model's (n, k), and their number outside its span.

    Both come from one basis of what the columns have outside the model. As the difference of two ranks and two sums
    of squares they could disagree in the last bit, and the fall was negative on some processors.
    """
    basis = orthonormal(model)
    outside = further - basis @ (basis.T @ further)
    outside -= basis @ (basis.T @ outside)  # twice: what rounding left of a long column is as large as a short one
    beyond = orthonormal(outside, np.linalg.norm(further, axis=0))
    return float(np.sum((beyond.T @ outputs) ** 2)), beyond.shape[1]
