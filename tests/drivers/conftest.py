"""Fixtures of tests of instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from declared_bench import DeclaredBench


@pytest.fixture
def bench() -> Iterator[Callable[..., DeclaredBench]]:
    """Makes benches from texts of files, and closes them."""
    made: list[DeclaredBench] = []

    def make(text: str, **how: Any) -> DeclaredBench:
        made.append(DeclaredBench(text, **how))
        return made[-1]

    yield make
    for one in made:
        one.close()
