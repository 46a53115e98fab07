"""Entry points of installed packages."""

from __future__ import annotations

import sys
from functools import cache
from importlib import metadata
from importlib.metadata import EntryPoint
from typing import Any


def entry_points(group: str) -> tuple[EntryPoint, ...]:
    """Those of a group; a package that is found on two paths gives each twice."""
    return _of(group, tuple(sys.path))


@cache
def _of(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    return tuple(_found(path).select(group=group))


@cache
def _found(_path: tuple[str, ...]) -> Any:
    """`EntryPoints` of all groups, cached for each search path of packages: a look-up takes 8 ms."""
    return metadata.entry_points()
