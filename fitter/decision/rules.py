"""Decision rules after JCGM 106, clause 8, and ILAC-G8:09/2019, and what they state of a measured value."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from scipy import special

from rig.fitter.decision.probability import conformity_probability
from rig.fitter.decision.tolerance import Tolerance
from rig.fitter.errors import FitError

Word = Literal["pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail"]
"""A statement of conformity.

pass, fail: conformity, or nonconformity.
conditionalPass, conditionalFail: inside, or outside the tolerance, and nearer to its limit than the guard band.
noPass, noFail: neither is stated, as the rule's demand on the uncertainty or on the probability is not met; the
quantity rather conforms, or rather does not.
"""


@dataclass(frozen=True)
class SimpleAcceptance:
    """Inside the tolerance is a pass, outside is a fail (JCGM 106, 8.2; ILAC-G8, 4.2.1)."""


@dataclass(frozen=True)
class SharedRisk:
    """Simple acceptance where the uncertainty is small enough, else no statement (JCGM 106, 8.2).

    Attributes:
        largest_share: of the expanded uncertainty in half the tolerance's width, or in `of` if it has one limit.
        of: what a tolerance with one limit is compared with, in its unit.

    """

    largest_share: float = 1.0 / 3.0
    of: float | None = None


@dataclass(frozen=True)
class GuardBand:
    """Acceptance limits moved inwards by a multiple of the expanded uncertainty (JCGM 106, 8.3; ILAC-G8, 4.2.2, 4.2.3).

    Attributes:
        factor: r of the guard band w = r U. Negative moves limits outwards (guarded rejection); then `binary`.
        binary: pass or fail alone; otherwise conditionalPass and conditionalFail within w of a limit.

    """

    factor: float = 1.0
    binary: bool = False


@dataclass(frozen=True)
class ProbabilityLimit:
    """A pass where the quantity conforms with this probability, a fail where it does not conform with it (JCGM 106, 7).

    Attributes:
        probability: more than 0.5, less than 1.

    """

    probability: float = 0.95


Rule = SimpleAcceptance | SharedRisk | GuardBand | ProbabilityLimit


@dataclass(frozen=True)
class Decision:
    """The statement of a rule about one measured value.

    Attributes:
        word: the statement.
        conformity_probability: that the quantity conforms, given its measured value.
        guard: width of the guard band; 0 for rules without.
        acceptance: measured values that pass; None if none can, or if the rule has no limits of its own.

    """

    word: Word
    conformity_probability: float
    guard: float
    acceptance: Tolerance | None

    @property
    def inside(self) -> bool:
        """Whether conformity is stated, or likelier than nonconformity."""
        return self.word in ("pass", "conditionalPass", "noPass")

    @property
    def specific_risk(self) -> float:
        """Probability that the statement is wrong: specific consumer's or producer's risk (JCGM 106, 9.3)."""
        return 1.0 - self.conformity_probability if self.inside else self.conformity_probability


def decide(
    value: float,
    standard_uncertainty: float,
    tolerance: Tolerance,
    rule: Rule,
    *,
    expanded_uncertainty: float,
    df: float = inf,
) -> Decision:
    """Apply a rule to a measured value.

    Args:
        value: measured, not rounded.
        standard_uncertainty: combined.
        tolerance: interval of conforming values, in the same unit.
        rule: agreed before the measurement.
        expanded_uncertainty: of the budget; guard bands are its multiples.
        df: effective degrees of freedom.

    Raises:
        FitError: an uncertainty is not positive, or the rule contradicts itself.

    Example:
        >>> offset = {"value": 0.8, "standard_uncertainty": 0.15, "expanded_uncertainty": 0.3}
        >>> decide(**offset, tolerance=Tolerance.around(0.0, 1.0), rule=SimpleAcceptance()).word
        'pass'
        >>> decide(**offset, tolerance=Tolerance.around(0.0, 1.0), rule=GuardBand()).word
        'conditionalPass'

    """
    probability = conformity_probability(value, standard_uncertainty, tolerance, df=df)
    if not expanded_uncertainty > 0.0:
        raise FitError(f"an expanded uncertainty of {expanded_uncertainty:g}: a decision needs one that is more than 0")
    inside = value in tolerance
    if isinstance(rule, ProbabilityLimit):
        return Decision(_by_probability(probability, rule), probability, 0.0, None)
    if isinstance(rule, GuardBand):
        guard = rule.factor * expanded_uncertainty
        return Decision(_by_guard(value, tolerance, guard, rule), probability, guard, tolerance.narrowed(guard))
    word: Word = "pass" if inside else "fail"
    if isinstance(rule, SharedRisk) and expanded_uncertainty > rule.largest_share * _room(tolerance, rule):
        return Decision("noPass" if inside else "noFail", probability, 0.0, None)
    return Decision(word, probability, 0.0, tolerance)


def guard_factor(risk: float, coverage_factor: float = 2.0, *, df: float = inf) -> float:
    """Multiple r of the expanded uncertainty with which a value at the acceptance limit is wrong with this probability.

    Of one limit; the other is far away (ILAC-G8, table 1: r = 1 for 2.3 %, 0.83 for 5 %, with k = 2).

    Raises:
        FitError: the risk is not between 0 and 1.

    """
    if not 0.0 < risk < 1.0:
        raise FitError(f"a risk of {risk:g}: it must be between 0 and 1")
    quantile = special.ndtri(1.0 - risk) if df == inf else special.stdtrit(df, 1.0 - risk)
    return float(quantile) / coverage_factor


def _by_probability(probability: float, rule: ProbabilityLimit) -> Word:
    if not 0.5 < rule.probability < 1.0:
        raise FitError(f"a probability limit of {rule.probability:g}: it must be more than 0.5 and less than 1")
    if probability >= rule.probability:
        return "pass"
    if 1.0 - probability >= rule.probability:
        return "fail"
    return "noPass" if probability >= 0.5 else "noFail"


def _by_guard(value: float, tolerance: Tolerance, guard: float, rule: GuardBand) -> Word:
    if rule.factor < 0.0 and not rule.binary:
        raise FitError(
            f"a guard band of {rule.factor:g} U with conditional statements: a negative one has pass and fail"
        )
    narrow, wide = tolerance.narrowed(guard), tolerance.narrowed(-guard)
    if narrow is not None and value in narrow:
        return "pass"
    if rule.binary or (wide is not None and value not in wide):
        return "fail"
    return "conditionalPass" if value in tolerance else "conditionalFail"


def _room(tolerance: Tolerance, rule: SharedRisk) -> float:
    if rule.of is not None:
        return rule.of
    if tolerance.width == inf:
        raise FitError("shared risk of a tolerance with one limit: say with `of` what the uncertainty is compared with")
    return 0.5 * tolerance.width
