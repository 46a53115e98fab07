"""Results of a trace of any kind of run: effects found, remainder without a name, verdict."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Generic, TypeVar

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Entry
from rig.fitter.json_values import JsonValue
from rig.fitter.trace.aliases import Rival
from rig.fitter.trace.outcome import LEFT_OUT, Finding, Instead, Outcome, Parameter, Row, WithError, run_json
from rig.fitter.trace.signs import Refused

CONFIRMED = 0.8
"""Left-out error after over before, above which the effects do not generalise to left-out data."""


S = TypeVar("S")
E = TypeVar("E", bound=Finding)


@dataclass(frozen=True, eq=False)
class TracedSensor(Generic[S, E]):
    """Findings in one sensor.

    Attributes:
        sensor: column name of its output.
        declared: the declared model.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained"; findings about the noise add
            nothing to the model.
        before: with the declared model.
        after: with the effects removed.
        rows: both as rows of a table.
        effects: found, largest share first, findings about the noise last.
        unnamed: the remainder, if it exceeds error.
        notes: sentences shown with the numbers before and after.
        fitted: coefficients of the declared model and of the effects, fitted together.
        instead: one shape without a name in place of the doubtful effects.
        refused: causes that would fit, except for their required sign or their size; None for kinds without refusals.
    """

    sensor: str
    declared: str
    verdict: str
    before: S
    after: S
    rows: tuple[tuple[Row, ...], tuple[Row, ...]]
    effects: tuple[E, ...]
    unnamed: tuple[Finding, ...]
    notes: tuple[str, ...]
    fitted: tuple[Parameter, ...]
    instead: Instead | None = field(default=None, kw_only=True)
    refused: tuple[Refused, ...] | None = field(default=None, kw_only=True)

    @property
    def added(self) -> tuple[E, ...]:
        """Effects that add to the model."""
        return tuple(effect for effect in self.effects if effect.kind != "noise")

    @property
    def noise(self) -> tuple[E, ...]:
        """Findings about the noise."""
        return tuple(effect for effect in self.effects if effect.kind == "noise")

    def outcome(self) -> Outcome:
        """The same in the form of every kind of run."""
        return Outcome(
            self.sensor,
            self.declared,
            self.verdict,
            (*self.effects, *self.unnamed),
            *self.rows,
            self.fitted,
            self.notes,
            None if self.refused is None else tuple(one.to_json() for one in self.refused),
            instead=self.instead,
        )


C = TypeVar("C")
Described = TypeVar("Described", bound=Entry)
T = TypeVar("T", bound=TracedSensor[Any, Any])


@dataclass(frozen=True, eq=False)
class TracedRun(ABC, Generic[T, C]):
    """Findings in a run of several sensors.

    Attributes:
        sensors: by column name.
        scene: references of the effects' columns.
        chosen: the terms in the model.
        gamma: (q,) their coefficients, in the terms' own units.
        taken: (S, q) one where a term is taken out of a sensor's output, zero where it is left in.
        points: number of observations.
        explanations: all of them for each effect found, best first.
        kind: of the run.
    """

    sensors: Mapping[str, T]
    scene: Any
    chosen: tuple[C, ...]
    gamma: FloatArray
    taken: FloatArray
    points: int
    explanations: Mapping[str, tuple[Explanation, ...]] = field(default_factory=dict, kw_only=True)
    kind: ClassVar[str]

    @property
    def about(self) -> dict[str, JsonValue]:
        """Properties of the run as JSON values."""
        return {"points": self.points, "kind": self.kind}

    @property
    @abstractmethod
    def reference(self) -> dict[str, JsonValue]:
        """References at which the effects' columns are zero, as JSON values."""

    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each sensor, in the form of every kind of run."""
        return tuple(found.outcome() for found in self.sensors.values())

    def to_json(self, file: str | None = None) -> dict[str, JsonValue]:
        """JSON values for `rig trace --json`; missing numbers are None, never NaN."""
        return run_json({"file": file, **self.about}, self.outcomes(), reference=self.reference)


def parameters_of(
    effects: Iterable[Finding], names: Sequence[str], values: FloatArray, stderr: FloatArray, df: FloatArray
) -> tuple[Parameter, ...]:
    """Coefficients of the declared model by their names, and of the effects; of a joint fit the latter come last."""
    declared = zip(names, values, stderr, df, strict=False)
    own = (Parameter(name, WithError(float(v), float(e), float(df))) for name, v, e, df in declared)
    return (*own, *(one for effect in effects for one in effect.parameters))


def experiments(
    effect: Described, aliases: Iterable[Described], separate: Callable[[Described, Described], str]
) -> str:
    """Recommended measurement: against each alias if there are any, otherwise to confirm the effect."""
    return "; ".join(dict.fromkeys(separate(effect, alias) for alias in aliases)) or effect.separate_by


def of_left_out(
    before: float | None, after: float | None, what: str, how: str, most: float = CONFIRMED, *, asked: bool
) -> tuple[str, ...]:
    """Sentences about the error on data left out.

    Args:
        before: the error, with the declared model; None if nothing was left out.
        after: with the effects.
        what: what was left out: "whole plots".
        how: how.
        most: of the error before, beyond which effects are not confirmed.
        asked: whether effects were found that it tests.
    """
    if before is None or after is None:
        return ()
    ratio = f"not confirmed by {what} left out: with the effects found the error on those is {after / before:.0%} of "
    failed = (f"{ratio}what it is without them",) if asked and after > most * before else ()
    return (*failed, f"{LEFT_OUT}{how}")


def with_shares(
    shown: Iterable[E], divided: FloatArray, doubt: Callable[[E], str | None], left_in: AbstractSet[str] = frozenset()
) -> tuple[E, ...]:
    """The effects of a sensor with their shares (q,) and doubts, largest share first; some are left in its output."""
    every = [
        replace(effect, share=float(share), doubtful=doubt(effect), left_in=effect.effect in left_in)
        for effect, share in zip(shown, divided, strict=True)
    ]
    return tuple(ties.ordered(every, key=lambda effect: -effect.share, unit=1.0))


def verdict(*, found: bool, fell: bool, rest: Iterable[Finding], doubtful: bool = False, perhaps: bool = False) -> str:
    """One word or two for a sensor, by one rule in every kind of run.

    Findings about the noise are not effects: they explain nothing, and nothing is added to the model for them. A wander
    of the error that may be an effect is not explained, but doubts none that is found.

    Args:
        found: whether effects were found, without findings about the noise.
        fell: whether the error is smaller with them.
        rest: what is left.
        doubtful: whether any name of an effect is.
        perhaps: whether a finding about the noise may be an effect.

    """
    rest = tuple(rest)
    remains = any(one.stratum != "noise" for one in rest)
    if found:
        return "explained" if fell and not remains and not doubtful else "partly explained"
    return "unexplained" if rest or perhaps else "nothing to add"


@dataclass(frozen=True)
class Explanation:
    """One explanation of a finding.

    Attributes:
        effect: name in the catalogue.
        terms: used candidates of the effect.
        sigmas: standard errors by which it is worse than the best explanation.
        alias: whether the data cannot distinguish it from the best.
        near: whether the data exclude it, but barely.
    """

    effect: str
    terms: tuple[Any, ...]
    sigmas: float
    alias: bool
    near: bool = False


def explanations_of(
    classes: Mapping[str, Sequence[Rival]], candidates: Sequence[Any]
) -> dict[str, tuple[Explanation, ...]]:
    """Explanations of every effect found, by its name, from what a search knows by index."""
    return {
        name: tuple(
            Explanation(r.effect, tuple(candidates[j] for j in r.terms), r.sigmas, r.alias, r.near) for r in rivals
        )
        for name, rivals in classes.items()
    }
