"""Results of a trace of any kind of run: effects found, remainder without a name, verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from rig.fitter.json_values import JsonValue
from rig.fitter.trace.aliases import Rival
from rig.fitter.trace.outcome import Finding, Parameter, WithError
from rig.fitter.trace.shape import Shape

CONFIRMED = 0.8
"""Left-out error after over before, above which the effects do not generalise to left-out data."""


@dataclass(frozen=True, eq=False)
class Found:
    """An effect in one sensor, in any kind of run.

    Attributes:
        effect: name in the catalogue.
        cause: the physical mechanism.
        stratum: where it was found.
        terms: its terms as formulas, without those that have no effect on this sensor.
        coefficients: of the formulas, in `unit`.
        stderr: of the coefficients; conditional on the effect having been selected on the same data.
        unit: of the coefficients.
        size: of the cause, in physical terms: "1.50e-3 deg/g", "45 ppm/degC", "1.2 arcsec".
        p_adjusted: probability of such a finding by chance, over all candidates, sensors and steps of the run.
        p_adjusted_is_bound: whether the probability is only known to be at most `p_adjusted`, by the number of
            simulations.
        share: its share of the sensor's whole error beyond scatter; the sum over all effects is at most one
            (`rig.fitter.trace.shares`).
        aliases: other effects that the data cannot distinguish from it.
        separation: standard errors by which every other explanation is worse, by effect.
        separate_by: the measurement that would separate it from its aliases, with the expected size.
        against: field of the data for a plot.
        doubtful: why its name should not be believed yet; None where nothing is against it.
        left_in: whether the numbers after leave it in the output, because the error would be larger without it.
    """

    effect: str
    cause: str
    stratum: str
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    stderr: tuple[float, ...]
    unit: str
    size: str
    p_adjusted: float
    p_adjusted_is_bound: bool
    share: float
    aliases: tuple[str, ...]
    separation: Mapping[str, float]
    separate_by: str
    against: str
    doubtful: str | None = field(default=None, kw_only=True)
    left_in: bool = field(default=False, kw_only=True)

    @classmethod
    def of_noise(
        cls,
        *,
        effect: str,
        cause: str,
        terms: tuple[str, ...],
        coefficients: tuple[float, ...],
        unit: str,
        size: str,
        p_adjusted: float,
        separate_by: str,
        against: str,
        aliases: tuple[str, ...] = (),
        **more: Any,
    ) -> Self:
        """A finding about the noise: no column of the model, so no share or standard errors.

        Arguments are the attributes of these names; `more` has those of one kind of run.
        """
        return cls(
            effect=effect,
            cause=cause,
            stratum="noise",
            terms=terms,
            coefficients=coefficients,
            stderr=(float("nan"),) * len(coefficients),
            unit=unit,
            size=size,
            p_adjusted=p_adjusted,
            p_adjusted_is_bound=False,
            share=0.0,
            aliases=aliases,
            separation={},
            separate_by=separate_by,
            against=against,
            **more,
        )

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for this kind of run only."""
        return {}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its coefficients as rows after those of the declared model, where it is taken out."""
        if self.left_in:
            return ()
        rows = zip(self.terms, self.coefficients, self.stderr, strict=True)
        named = ((f"{self.effect}: {term}", WithError(value, error)) for term, value, error in rows)
        return tuple(Parameter(name, estimate, unit=self.unit) for name, estimate in named)

    def finding(self) -> Finding:
        """The same in the form of every kind of run."""
        return Finding(
            kind="noise" if self.stratum == "noise" else "effect",
            cause=self.cause,
            stratum=self.stratum,
            share=self.share,
            effect=self.effect,
            terms=self.terms,
            coefficients=self.coefficients,
            stderr=self.stderr,
            unit=self.unit,
            size=self.size,
            p_adjusted=self.p_adjusted,
            p_adjusted_is_bound=self.p_adjusted_is_bound,
            aliases=self.aliases,
            separation=self.separation,
            separate_by=self.separate_by,
            doubtful=self.doubtful,
            more=self.own_keys,
        )


@dataclass(frozen=True)
class Unnamed:
    """The remainder that no effect of the catalogue explains: its place, and its share.

    In a finished trace the share is of the whole error beyond scatter, like the shares of the effects.

    Attributes:
        where: its place.
        share: see above.
        added: whether a smooth term without a cause was added for it.
        stratum: "noise" if it is a random walk; otherwise "unnamed".
        shape: it as a curve or a surface, with the nearest names; None where it has none.
    """

    where: str
    share: float
    added: bool = field(default=False, kw_only=True)
    stratum: str = field(default="unnamed", kw_only=True)
    shape: Shape | None = field(default=None, kw_only=True, compare=False)

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for this kind of run only."""
        return {}

    def finding(self) -> Finding:
        """The same in the form of every kind of run."""
        return Finding(
            "unnamed",
            self.where,
            self.stratum,
            self.share,
            added=self.added,
            shape=self.shape,
            more=self.own_keys,
        )


def verdict(*, found: bool, fell: bool, rest: Iterable[Unnamed], doubtful: bool = False) -> str:
    """One word or two for a sensor, by one rule in every kind of run.

    Findings about the noise are not effects: they explain nothing, and nothing is added to the model for them.

    Args:
        found: whether effects were found, without findings about the noise.
        fell: whether the error is smaller with them.
        rest: what is left.
        doubtful: whether any name of an effect is.

    """
    remains = any(one.stratum != "noise" for one in rest)
    if found:
        return "explained" if fell and not remains and not doubtful else "partly explained"
    return "unexplained" if remains else "nothing to add"


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
