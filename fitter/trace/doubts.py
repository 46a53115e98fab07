"""Why a name should not be believed yet: sentences, and the limits at which they are said, for every kind of run."""

from __future__ import annotations

from collections.abc import Sequence

DOUBT = 1e-2
"""Something is left where an effect was found, of which chance makes as much less often than this: it is doubtful."""
BUNDLE = 3
"""Names that arrive together in the same sensors at one level, from which on they are rather parts of one shape."""
EARNED = 3.0
"""Nats by which a name must be likelier than the likeliest shape without one: odds of 20 to 1."""


def something_left(place: str, p: float) -> str:
    """Something is left beside it."""
    return f"the residual still follows a shape {place} that it does not explain (p = {p:.1g})"


def bundle(names: Sequence[str]) -> str:
    """Several names arrive together."""
    return (
        f"{len(names)} effects were found together in the same readings ({', '.join(names)}): one unlisted cause "
        "would look like this"
    )


def no_better(names: Sequence[str], place: str) -> str:
    """One shape without a name explains as much."""
    one = "it does" if len(names) == 1 else f"{' and '.join(names)} do together"
    return f"a shape without a name, {place}, explains as much as {one}"


def in_several(sensors: Sequence[str]) -> str:
    """An effect of single sensors arrives in several at once."""
    return f"{', '.join(sensors)} show it at once, each with its own coefficient: a common cause would look like this"


def beside(stronger: str) -> str:
    """A stronger effect of much the same shape is there."""
    return f"it is small compared with {stronger}, and a small error in the law of {stronger} would look like this"


def several_values(count: int) -> str:
    """An effect with one searched constant takes several values of it at once."""
    return f"it takes {count} values of a constant that has one true value: together they can have almost any shape"
