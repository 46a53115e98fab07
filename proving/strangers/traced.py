"""A stranger's table through the same trace as the command's."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeVar
from unittest.mock import patch

import rig
import rig.procedures.attitude.trace.run
import rig.procedures.general.trace.report
import rig.procedures.pressure.trace.run
from proving.strangers.sets import Made

LISTS = ("group", "candidates", "ignore")
"""Options that can be given several times."""
T = TypeVar("T")


def options_of(words: Sequence[str]) -> dict[str, Any]:
    """Options of `rig trace` in Python, from words of the command line: pairs of `--name` and a value."""
    if len(words) % 2 or any(not word.startswith("--") for word in words[::2]):
        raise ValueError(f"options are pairs of --name and a value: {' '.join(words)}")
    options: dict[str, Any] = {}
    for name, value in zip(words[::2], words[1::2], strict=True):
        key = name.removeprefix("--").replace("-", "_")
        if key in LISTS:
            options.setdefault(key, []).append(value)
        else:
            options[key] = float(value) if key == "wrap" else value
    return options


def with_file(made: Made, work: Callable[[Path], T]) -> T:
    """Do something with the table as a file."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder) / "table.csv"
        path.write_text(made.csv, encoding="utf-8")
        return work(path)


LEFT_OUT = (rig.procedures.attitude.trace.run, rig.procedures.pressure.trace.run, rig.procedures.general.trace.report)
"""Modules that repeat the search without some of the rows, by their `left_out`."""


@contextmanager
def without_left_out() -> Iterator[None]:
    """Without the error on rows left out: it takes most of the time of a trace, and decides nothing."""
    with ExitStack() as stack:
        for module in LEFT_OUT:
            stack.enter_context(patch.object(module, "left_out", _none))
        yield


def _none(*_: Any, **__: Any) -> None:
    return None


def traced(made: Made, *, left_out: bool = True) -> dict[str, Any]:
    """The JSON values that `rig trace --json` prints. Raises what `rig.Data.trace` does.

    Args:
        made: the table.
        left_out: with the error on rows left out.

    """

    def work(path: Path) -> dict[str, Any]:
        with nullcontext() if left_out else without_left_out():
            found: dict[str, Any] = rig.open(path).trace(**options_of(list(made.options))).to_json()
        return found

    return with_file(made, work)
