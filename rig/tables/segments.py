"""A run with the replications that were added to it: one table of several run files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.errors import UsageError
from rig.procedures.tables.table import Table
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table

_COUNTED = ("replicate", "whole_plot", "order", "run_index", "block")


def table_of(segments: Sequence[Path], path: Path) -> Table:
    """The table of a run file; of the first segment, that of all segments one after the other.

    Raises:
        UsageError: they have other columns.
        RunFileError: one is damaged, or holds no observations.
    """
    return joined(segments) if path.resolve() == segments[0].resolve() else run_table(path)


def joined(segments: Sequence[Path]) -> Table:
    """The table of all segments, one after the other; errors as for `table_of`."""
    tables = [run_table(one) for one in segments]
    if len(tables) == 1:
        return tables[0]
    first, columns = tables[0], {name: [values] for name, values in tables[0].columns.items()}
    began = [_began_s(one) for one in segments]
    for table, begins_s in zip(tables[1:], began[1:], strict=True):
        if table.columns.keys() != first.columns.keys():
            raise UsageError(f"{table.source} has other columns than {first.source}: they are no segments of one run")
        for name, values in table.columns.items():
            before = columns[name][-1]
            after = values
            if name in _COUNTED:
                after = values + np.nanmax(before) + (name == "block")
            elif name == "elapsed_s":
                after = values + begins_s - began[0]
            columns[name].append(after)
    every = {name: np.concatenate(values) for name, values in columns.items()}
    points = {key: sum(one.provenance[key] for one in tables) for key in ("points_planned", "points_observed")}
    last = {"last_observation_utc": tables[-1].provenance["last_observation_utc"]}
    told = {"segments": ", ".join(f"{Path(one.source).name} {one.provenance['head']}" for one in tables)}
    return replace(first, columns=every, within={}, provenance={**first.provenance, **points, **last, **told})


def _began_s(path: Path) -> float:
    with RunReader.open(path) as reader:
        return reader.genesis().utc_s
