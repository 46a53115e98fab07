"""Reasons for doubt about a name: sentences and their limits, for every kind of run."""

from __future__ import annotations

from collections.abc import Sequence

from rig.fitter.effects.entry import Entry
from rig.fitter.quantiles import t_tail

DOUBT = 1e-2
"""Probability of a remainder at the place of an effect, below which the effect is doubtful."""
CHANGES = 1e-3
"""The same of a change of its coefficient, over all variables that it may change with."""
BUNDLE = 3
"""Number of names found together in the same sensors at one level, from which on they may be parts of one shape."""
PERIODS = 2.0
"""Number of periods in the data, below which an oscillation in time is doubtful: it has not come back yet."""
MANY = 4
"""Number of causes of other families or variables that the data cannot tell from a name, from which it is doubtful."""

CHANCE = 5e-3
"""Probability of a finding by chance, over all candidates, above which its name is doubtful. Beside effects between
whole plots, wrong names with 0.008 to 0.03 stood in 4 of 42 runs."""


def by_chance(p: float | None) -> str | None:
    """Sentence about a finding that chance gives now and then; None where it hardly does."""
    return None if p is None or p <= CHANCE else f"chance alone would show as much in {1000.0 * p:.0f} of 1,000 runs"


def beyond_chance(coefficients: Sequence[float], errors: Sequence[float], df: float | None, tried: int) -> bool:
    """Whether a probability that is only a bound, by the number of simulated runs, stands for one that is no doubt.

    By the largest of some coefficients in standard errors, over all that were tried (Bonferroni).
    """
    known = [abs(c / e) for c, e in zip(coefficients, errors, strict=True) if e > 0.0]
    return df is not None and bool(known) and tried * t_tail(max(known), df) <= CHANCE


def something_left(place: str, p: float) -> str:
    """Sentence about a remainder."""
    return f"it does not explain all: the residual still follows a shape {place} (p = {p:.1g})"


def not_constant(over: str, p: float) -> str:
    """Sentence about a coefficient that changes over the data."""
    return f"its coefficient is no constant: it changes {over} (p = {p:.1g})"


def one_that_changes(name: str, other: str, over: str) -> str:
    """Sentence about two names that may be one."""
    return f"{name} with a coefficient that changes {over} explains as much as {name} and {other} do together"


def not_sudden() -> str:
    """Sentence about a step."""
    return "a change that goes on for a good part of the run explains as much as a sudden one"


def bundle(names: Sequence[str]) -> str:
    """Sentence about several names found together; of more than two each has it, so that it does not list them."""
    which = f" ({', '.join(names)})" if len(names) == 2 else ""
    return (
        f"{len(names)} effects were found together in the same readings{which}: one unlisted cause would look like this"
    )


def no_better(names: Sequence[str], place: str) -> str:
    """Sentence about a shape without a name that explains as much."""
    one = "it does" if len(names) == 1 else f"{' and '.join(names)} do together"
    return f"a shape without a name, {place}, explains as much as {one}"


def in_several(sensors: Sequence[str]) -> str:
    """Sentence about an effect of single sensors that is found in several at once."""
    return f"{', '.join(sensors)} show it at once, each with its own coefficient: a common cause would look like this"


def shown_by_another(sensor: str, place: str) -> str:
    """Sentence about a shape without a name that another sensor follows at the same time."""
    return f"{sensor} follows a shape without a name, {place}, and not this: one cause of both would look like this"


def under_another_name(sensor: str, other: str) -> str:
    """Sentence about a name that the data cannot tell from a doubtful one of another sensor."""
    return f"these data cannot tell it from {other}, which is doubtful in {sensor}: it may be one cause of both"


def few_periods(count: float) -> str:
    """Sentence about an oscillation of which the data have few periods."""
    return f"the data have {count:.1f} of its periods: something that wanders slowly would look like this"


def another_law(name: str, *, corner: bool = True) -> str:
    """Sentence about a law beside which another one, with or without a corner, explains as much."""
    what = f"{name}, a law with a corner," if corner else name
    return f"{what} explains as much: how it depends on the variable is not known"


def several_values(count: int) -> str:
    """Sentence about an effect that uses several values of its searched constant at once."""
    return f"it was found with {count} values of its constant, and a cause has one: together they follow any shape"


def rests_on(rows: Sequence[int]) -> str:
    """Sentence about an effect that no other rows show."""
    *others, last = map(str, rows)
    which = f"rows {', '.join(others)} and {last}" if others else f"row {last}"
    return f"it rests on {which}: the other rows do not show it"


def several_causes(count: int) -> str:
    """Sentence about a name that is one of many."""
    return f"{count} causes explain these data alike, and a cause that is not listed may do so too"


def one_apart() -> str:
    """One whole plot that is off explains as much as a name."""
    return "one whole plot that is off by itself explains as much: nothing else shows it"


def error_rises() -> str:
    """Sentence about an effect with which the error of a sensor is larger."""
    return "the error of all strata is larger with it than with the declared model alone: it is not taken out"


def beside_a_wander() -> str:
    """Sentence about a slow effect beside neighbouring errors that are alike."""
    return "errors of neighbouring rows are alike: something wanders slowly, and this may be a part of it"


def not_predicted() -> str:
    """Sentence about effects with which data that were left out are predicted worse."""
    return "data that are left out are predicted worse with the effects found than without them"


def two_sizes(names: Sequence[str], sensor: str) -> str:
    """Sentence about a cause of all sensors beside one of a single sensor that has the same shape there."""
    wide, own = names
    return f"in {sensor}, {own} has the shape of {wide}: this sensor asks for another size than {wide} has"


def by_the_history(entry: Entry, other: Entry) -> str:
    """Sentence about a name that a laboratory's history puts before another one."""
    (own, calibrations), (others, _) = entry.history or (0, 0), other.history or (0, 0)
    return (
        f"these data alone would name {other.name}: the laboratory's history decides, {own} of {calibrations} "
        f"calibrations with {entry.name} and {others} with {other.name}"
    )
