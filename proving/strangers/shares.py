"""Shares of runs with their intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any

from proving.strangers.scoring import CLASSES, WRONG, WRONG_MARKED

Figures = dict[str, Any]
Z = 1.959963984540054
"""Standard normal deviate of a two-sided 95 % interval."""


def wilson(count: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share, both ends between 0 and 1 (Wilson 1927)."""
    if of == 0:
        return 0.0, 1.0
    share, z2 = count / of, Z * Z / of
    middle, half = share + z2 / 2, Z * sqrt(share * (1 - share) / of + z2 / (4 * of))
    return max(0.0, (middle - half) / (1 + z2)), min(1.0, (middle + half) / (1 + z2))


def share(count: int, of: int) -> Figures:
    """A count with the share's interval in per cent."""
    return {"count": count, "of": of, "percent_95": [round(100 * end, 1) for end in wilson(count, of)]}


def classes(results: Sequence[Mapping[str, Any]]) -> Figures:
    """How many runs are of each class, and what is counted besides."""
    runs = len(results)
    of_class = Counter(one["class"] for one in results)
    left_out = [one["left_out_rose"] for one in results if one["left_out_rose"] is not None]
    hidden = [found for one in results for found in one["found"]]
    return {
        **{name: share(of_class[name], runs) for name in CLASSES},
        "wrong and nothing marked in any sensor": share(sum(one["unmarked"] for one in results), runs),
        "hidden causes named or among the aliases": share(sum(hidden), len(hidden)),
        "right by near names only": share(sum(one["near"] for one in results), runs),
        "error after above error before": share(sum(one["rose"] for one in results), runs),
        **({"the same on rows left out": share(sum(left_out), len(left_out))} if left_out else {}),
    }


def alarms(results: Sequence[Mapping[str, Any]]) -> Figures:
    """Nulls in which anything was named or unnamed."""
    runs = len(results)
    named = [one for one in results if one["class"] in {WRONG, WRONG_MARKED}]
    return {
        "false alarms": share(sum(one["alarm"] for one in results), runs),
        "but for replications that differ": share(
            sum(one["alarm"] and not one["only_differ"] for one in results), runs
        ),
        "a name that is not doubtful": share(len(named), runs),
        "findings about the noise": sum(one["noise"] for one in results),
        "refused": sum(one["class"] == "refused" for one in results),
        "crash": sum(one["class"] == "crash" for one in results),
    }
