"""What the straight line lacks: hysteresis between up and down, and drift; searched with the shared parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from acme_rig.tilt.fit import TERMS, UNIT, about, columns, outputs, unused
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.linear import LinearFit, least_squares, orthonormal
from rig.fitter.quantiles import t_limit, t_tail
from rig.fitter.trace.chance import ALPHA, DRAWS, Family
from rig.fitter.trace.found import verdict
from rig.fitter.trace.outcome import Finding, Outcome, Parameter, Row, WithError, run_json
from rig.fitter.trace.search import search
from rig.fitter.trace.shares import shares
from rig.procedures.errors import DataError
from rig.procedures.evaluate.certificate import Change, Errors, certified, with_words
from rig.procedures.evaluate.results import Page
from rig.procedures.present.blocks import Block, Line, headline
from rig.procedures.present.effects_report import effects_part
from rig.procedures.present.effects_shown import show_certificate, show_effect
from rig.procedures.tables.table import Table

_SEED = 20260115


@dataclass(frozen=True)
class Effect:
    """An entry of the catalogue."""

    name: str
    cause: str
    term: str
    unit: str
    separate_by: str


EFFECTS = (
    Effect("hysteresis", "the sensor, or the head, lags behind", "side", "V", "approach every angle from one side"),
    Effect("offset-drift", "the offset drifts at a constant rate", "hours", "V/h", "run the angles in another order"),
)


@dataclass(frozen=True, eq=False)
class TiltJudge:
    """One sensor's candidates. See `rig.fitter.trace.search.Searched`.

    Attributes:
        declared: (n, 2) columns of the declared model.
        terms: (n, q) columns of the candidates.
        volts: (n,) output.

    """

    declared: FloatArray
    terms: FloatArray
    volts: FloatArray

    def unit(self, j: int) -> tuple[int, ...]:
        """Every effect is one column."""
        return (j,)

    def fit(self, chosen: tuple[int, ...]) -> LinearFit:
        """With the chosen effects."""
        names = (*TERMS, *(EFFECTS[j].name for j in chosen))
        return least_squares(np.column_stack([self.declared, self.terms[:, list(chosen)]]), self.volts, names)

    def p_adjusted(self, chosen: tuple[int, ...], j: int) -> float:
        """Probability that the best of the family looks as good as `j` by chance."""
        fit = self.fit((*(k for k in chosen if k != j), j))
        return float(self.family.adjust(t_tail(fit.coefficients[-1] / fit.stderr[-1], fit.df)))

    def best(self, chosen: tuple[int, ...]) -> tuple[int, ...]:
        """The effect that stands out most, of those that do."""
        p = {j: self.p_adjusted(chosen, j) for j in range(len(EFFECTS)) if j not in chosen}
        first = min(p, key=lambda j: p[j], default=None)
        return () if first is None or p[first] > ALPHA else (first,)

    def refined(self, chosen: tuple[int, ...]) -> TiltJudge:
        """No constant is searched."""
        return self

    @cached_property
    def family(self) -> Family:
        """What chance does to the smallest p of all candidates, in runs in which nothing is missing."""
        n, k = self.declared.shape
        basis, rng = orthonormal(self.declared), np.random.default_rng(_SEED)
        beyond = self.terms - basis @ (basis.T @ self.terms)
        beyond /= np.linalg.norm(beyond, axis=0)
        noise = rng.standard_normal((DRAWS, n))
        noise -= (noise @ basis) @ basis.T
        r_squared = (noise @ beyond) ** 2 / np.sum(noise**2, axis=1)[:, None]
        t = np.sqrt(r_squared.max(axis=1) / (1.0 - r_squared.max(axis=1)) * (n - k - 1))
        return Family(np.sort([t_tail(value, n - k - 1) for value in t.tolist()]))


def outcome(name: str, table: Table) -> Outcome:
    """What is said of one sensor. Raises `FitError` where its line is not determined."""
    given = table.columns
    terms = np.column_stack([given["pitch_side"] / 2.0, (given["elapsed_s"] - given["elapsed_s"].mean()) / 3600.0])
    start = TiltJudge(columns(given["pitch_deg"]), terms, given[name])
    judge, chosen = search(start)
    before, after = judge.fit(()), judge.fit(chosen)
    parts = [terms[:, j] * value for j, value in zip(chosen, after.coefficients[len(TERMS) :], strict=True)]
    left = given[name] - before.predict(start.declared)
    share = shares(parts, left, after.sigma**2 * before.df)
    findings = tuple(_finding(name, judge, chosen, j, float(one)) for j, one in zip(chosen, share, strict=True))
    rows = [(Row("sigma_E", f.sigma, UNIT, label="standard error / uV", scale=1e6),) for f in (before, after)]
    values = zip(after.names, after.coefficients.tolist(), after.stderr.tolist(), strict=True)
    fitted = tuple(Parameter(term, WithError(value, error, after.df)) for term, value, error in values)
    word = verdict(found=bool(findings), fell=after.sigma < before.sigma, rest=())
    told = Outcome(name, "line in sin(pitch)", word, findings, *rows, fitted, ())
    change = Change("the standard error of one observation", 1e6 * before.sigma, 1e6 * after.sigma, "uV")
    lacks = f"it lacks {' and '.join(one.effect for one in findings)}" if findings else word
    return certified(told, f"{name}: {lacks}; {change.from_to('goes')}.", Errors([change]))


def _finding(name: str, judge: TiltJudge, chosen: tuple[int, ...], j: int, share: float) -> Finding:
    effect, fit = EFFECTS[j], judge.fit(chosen)
    at = len(TERMS) + chosen.index(j)
    value, error, p = float(fit.coefficients[at]), float(fit.stderr[at]), judge.p_adjusted(chosen, j)
    half = t_limit(0.95, fit.df) * error
    found = Finding("effect", effect.cause, "point-by-replication", share, effect.name, (effect.term,), (value,))
    found = replace(found, stderr=(error,), unit=effect.unit, size=f"{1e6 * value:.3g} u{effect.unit}", p_adjusted=p)
    found = replace(found, p_adjusted_is_bound=p <= judge.family.least, separate_by=effect.separate_by)
    return with_words(name, found, (half,), f"{1e6 * (value - half):.3g} to {1e6 * (value + half):.3g} u{effect.unit}")


@dataclass(frozen=True)
class TiltTraced:
    """A table and what was traced in it. See `rig.procedures.evaluate.results.Traced`."""

    table: Table
    kind: str
    outcomes: tuple[Outcome, ...]

    def to_json(self) -> dict[str, Any]:
        """What `rig trace --json` prints."""
        data = {"file": self.table.source, **about(self.table, self.kind)}
        return run_json(data, self.outcomes, unused=unused(self.table).to_json())

    def blocks(self) -> Iterator[Block]:
        """What a person reads of it."""
        yield headline(self.table.source, self.table)
        for found in self._sensors():
            yield Line(found["sentence"], wrapped=True)
            for effect in found["effects"]:
                yield from show_effect(effect)
            yield from show_certificate(found)

    def page(self) -> Page:
        """Its report."""
        sensors = [{**found, "s": effects_part(found, {})} for found in self._sensors()]
        span_s = float(np.ptp(self.table.columns["elapsed_s"]))
        return Page(
            __package__, "report.html.j2", self.table, span_s, unused(self.table).to_json(), {"sensors": sensors}
        )

    def _sensors(self) -> Iterator[Mapping[str, Any]]:
        return ({"name": one.sensor, **one.to_json()} for one in self.outcomes)


def trace(table: Table, kind: str) -> TiltTraced:
    """Trace every sensor. Raises `DataError`."""
    try:
        return TiltTraced(table, kind, tuple(outcome(name, table) for name in outputs(table)))
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
