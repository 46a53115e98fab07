"""One run of a set: made, traced, scored. A worker does this."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rig.procedures.errors import DataError
from proving.strangers.judge import Judged, judge_of
from proving.strangers.scoring import (
    CRASH,
    REFUSED,
    alarm,
    class_of,
    found,
    line_of,
    only_differ,
    said_of,
    unmarked_in_the_run,
)
from proving.strangers.sets import Made, StrangerSet, load, opened
from proving.strangers.traced import traced
from rig.errors import RigError, UsageError

Scored = dict[str, Any]
"""JSON values of a run, the same on every machine."""


def hidden(
    seed: int,
    folder: Path,
    kind: str,
    effects: tuple[str, ...],
    size: float,
    judged: Path | None,
    *,
    left_out: bool = True,
) -> Scored:
    """A table with hidden causes, traced and scored."""
    stranger = load(folder)
    right = judge_of(stranger, judged).of(kind, effects)
    opened(stranger)
    about = " + ".join(f"{name}: {stranger.about(kind, name)}" for name in effects)
    return {
        **scored(made_of(stranger, kind, effects, seed, size), right, left_out=left_out),
        "seed": seed,
        "about": about,
    }


def null(seed: int, folder: Path, kind: str, noise: str) -> Scored:
    """A table with nothing hidden."""
    stranger = load(folder)
    opened(stranger)
    return {**scored(made_of(stranger, kind, (), seed, 0.0, noise), (), left_out=False), "seed": seed}


def made_of(
    stranger: StrangerSet, kind: str, effects: Sequence[str], seed: int, size: float, noise: str = "white"
) -> Made:
    """A table of a set. Raises `UsageError` if the set cannot make it."""
    try:
        return stranger.package.table(kind, effects, seed, size, noise)
    except Exception as error:
        what = f"{kind}, {' + '.join(effects) or 'nothing'}, seed {seed}, size {size:g}, noise {noise}"
        raise UsageError(f"{stranger.folder}: no table of {what}: {type(error).__name__}: {error}") from error


def scored(made: Made, right: Sequence[Judged], *, left_out: bool = True) -> Scored:
    """What the trace says of a table, and its class."""
    try:
        said = said_of(traced(made, left_out=left_out))
    except (RigError, DataError) as error:
        return _none(REFUSED, error, right)
    except Exception as error:
        return _none(CRASH, error, right)
    ways = [one.only_near(n.name) for s in said for n in s.names for one in right if one.names(n.name)]
    return {
        "class": class_of(said, right),
        "found": found(said, right),
        "unmarked": unmarked_in_the_run(said, right),
        "near": bool(ways) and all(ways),
        "alarm": alarm(said),
        "only_differ": only_differ(said),
        "noise": any(s.noise for s in said),
        "rose": any(s.rose for s in said),
        "left_out_rose": None if all(s.left_out_rose is None for s in said) else any(s.left_out_rose for s in said),
        "line": line_of(said),
    }


def _none(name: str, error: Exception, right: Sequence[Judged]) -> Scored:
    text = str(error).split("table.csv")[-1]
    return {
        "class": name,
        "found": [False] * len(right),
        **dict.fromkeys(("unmarked", "near", "alarm", "only_differ", "noise", "rose"), False),
        "left_out_rose": None,
        "line": f"{type(error).__name__}{text if 'table.csv' in str(error) else f': {text}'}",
    }
