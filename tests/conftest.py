"""Settings of all tests."""

from __future__ import annotations

import os
import resource
import signal
import sys
import threading
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

# Before anything imports numpy: matrices here are narrow, and threads that spin beside two test workers cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What a terminal ignores for its background processes, the controllers that tests start would ignore as well.
for ignored in (signal.SIGHUP, signal.SIGINT):
    if signal.getsignal(ignored) is signal.SIG_IGN:
        signal.signal(ignored, signal.SIG_DFL if ignored is signal.SIGHUP else signal.default_int_handler)

# Where bytecode is not kept, three workers and sixty processes compile the project and these tests again each; and
# Hypothesis, if it comes before this.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

from hypothesis import settings  # noqa: E402
from hypothesis.internal.conjecture import providers  # noqa: E402

# Every worker would read all modules for their constants, for 7 s, and a number changed anywhere would change examples.
providers._get_local_constants = lambda: providers._local_constants

# Seeded by the test's own name: a failure on one machine is the same failure on another.
settings.register_profile("seeded", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("seeded")

LONGEST = ("an_installed_wheel", "trace", "trace_whole_plots", "trace_effects", "kills", "confirm", "live_bench")
LONG = Path(__file__).parent / "long.txt"
"""Tests that `make test` leaves to `make test-all`."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of these tests."""
    parser.addoption("--quick", action="store_true", help="leave out the tests of tests/long.txt")
    parser.addoption("--processor-times", type=Path, help="add the processor time of every test to this file")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first, or one worker would still be at one of them when the others have nothing left."""
    place = {f"test_{name}": k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    long = _long(config, items)
    if config.getoption("--quick"):
        config.hook.pytest_deselected(items=[item for item in items if item in long])
        items[:] = [item for item in items if item not in long]


def _long(config: pytest.Config, items: list[pytest.Item]) -> set[pytest.Item]:
    """Tests that a line of the list names: a file, a function with all its parameters, or one of these."""
    lines = {line for line in LONG.read_text(encoding="utf-8").splitlines() if not line.startswith("#")}
    names = {item: {item.nodeid, item.nodeid.split("[")[0], item.nodeid.split("::")[0]} for item in items}
    # Where whole files are asked for, a line that names nothing is of a test that was renamed and would come back.
    if not any("::" in asked for asked in config.args):
        files = {item.nodeid.split("::")[0] for item in items}
        gone = {line for line in lines if line.split("::")[0] in files} - set().union(*names.values(), set())
        if gone:
            raise pytest.UsageError(f"{LONG.name} names tests that are not there: {', '.join(sorted(gone))}")
    return {item for item, its in names.items() if its & lines}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Note the processor time, with that of processes that a test started and waited for."""
    times: Path | None = item.config.getoption("--processor-times")
    before = _processor_s()
    try:
        return (yield)
    finally:
        if times is not None:
            with times.open("a", encoding="utf-8") as file:
                file.write(f"{_processor_s() - before:.3f} {item.nodeid}\n")


@pytest.fixture(autouse=True)
def no_thread_stays() -> Iterator[None]:
    """A server that a test leaves behind may take the processor from all tests after it, and once did."""
    before = set(threading.enumerate())
    yield
    stays = [one for one in threading.enumerate() if one not in before and "serve_forever" in one.name]
    assert not stays, f"still serving: {stays}"


def _processor_s() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)
