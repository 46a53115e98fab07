"""Settings of all tests."""

from __future__ import annotations

import os
import sys

import pytest

# Before anything imports numpy: matrices here are narrow, and threads that spin beside two test workers cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import settings

# Where bytecode is not kept, three workers and sixty processes compile the project and these tests again each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Seeded by the test's own name: a failure on one machine is the same failure on another.
settings.register_profile("seeded", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("seeded")


@pytest.fixture
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of what is drawn to judge effects tells 3.5 % from nothing as surely, where something is.

    For tests of something else than the level; runs with nothing in them are judged with all the draws.
    """
    monkeypatch.setattr("procedures.attitude.trace.family.DRAWS", 5_000)


LONGEST = ("an_installed_wheel", "trace", "trace_whole_plots", "trace_effects", "kills", "confirm", "live_bench")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, or one worker would still be at one of them when the others have nothing left."""
    place = {f"test_{name}": k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
