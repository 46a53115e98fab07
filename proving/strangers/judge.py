"""The judge's list of a set: which names of our catalogues are right for each of its causes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from proving.strangers.sets import KINDS, StrangerSet
from rig.errors import UsageError

NAME = "judged.json"


@dataclass(frozen=True)
class Judged:
    """What is right for one hidden cause. Patterns of a shell: `lag:*` is a lag of any column.

    Attributes:
        right: names of the same physical cause; empty for a cause that is in no catalogue.
        near: names that no run of this design can tell from it.

    """

    right: tuple[str, ...]
    near: tuple[str, ...]

    def names(self, name: str) -> bool:
        """Whether a name is right, or as good as right."""
        return _among(name, (*self.right, *self.near))

    def only_near(self, name: str) -> bool:
        """Whether it is as good as right, and not right."""
        return self.names(name) and not _among(name, self.right)

def _among(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


@dataclass(frozen=True)
class Judge:
    """The list of a whole set, by kind and effect."""

    lists: dict[tuple[str, str], Judged]

    def of(self, kind: str, effects: Sequence[str]) -> list[Judged]:
        """What is right for some hidden effects."""
        return [self.lists[kind, name] for name in effects]


def beside(folder: Path) -> Path:
    """The judge's list in a set's folder; else beside it, as `FOLDER_judged.json`."""
    inside = folder / NAME
    return inside if inside.is_file() else folder.with_name(f"{folder.name}_{NAME}")


def judge_of(stranger: StrangerSet, path: Path | None = None) -> Judge:
    """Read the judge's list of a set.

    Raises:
        UsageError: there is none, it is for another set, or an effect is missing.

    """
    path = beside(stranger.folder) if path is None else path
    if not path.is_file():
        raise UsageError(f"{path}: there is no judge's list; it is written after sealing and before the first trace")
    told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    if told["seal"] != stranger.seal:
        raise UsageError(f"{path}: the list is for a set with the seal {told['seal']}, not {stranger.seal}")
    lists = {
        (kind, name): Judged(tuple(one["right"]), tuple(one.get("near", ())))
        for kind in KINDS
        for name, one in told["kinds"].get(kind, {}).items()
    }
    for kind in stranger.modules:
        lacking = [one[0] for one in stranger.effects(kind) if len(one) == 1 and (kind, one[0]) not in lists]
        if lacking:
            raise UsageError(f"{path}: {kind} lacks {', '.join(lacking)}")
    return Judge(lists)
