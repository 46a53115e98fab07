"""Quantities that a factor sets in another unit: a valve in V, whose flow a standard reads in kg/min.

Their columns are those of any factor with a standard: what was read, its nominal value, and how it came to be set. The
setting itself has a column of its own. A nominal value is the mean of what was read at one setting over the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from rig.bench.approach import along
from rig.procedures.column_names import moves_of, stem_of, with_word
from rig.procedures.plan.run_list import RunList
from rig.run_file.state.documents import Stored

_DIGITS = 4
"""Digits of a nominal value."""


def put_in_place(rows: Sequence[dict[str, float]], run_list: RunList, bench: Stored) -> dict[str, str]:
    """Give every row these columns in place of the factor's own; returns columns of settings, by quantity."""
    found, replaced = dict[str, str](), set[str]()
    for name, of in _read_of(run_list, bench):
        factor = run_list.factor(of)
        known = [row for row in rows if math.isfinite(row.get(name, math.nan))]
        if not known:
            continue
        for row in rows:  # a factor with a standard of its own has its setting already
            row.setdefault(factor.set_name, row.get(of, math.nan))
        levels = sorted({row[factor.set_name] for row in known})
        at = {v: [row[name] for row in known if row[factor.set_name] == v] for v in levels}
        nominal = [float(f"{np.mean(read):.{_DIGITS}g}") for read in at.values()]
        found[name] = factor.set_name
        rises = 1.0 if nominal[-1] >= nominal[0] else -1.0
        (since, start), side = moves_of(of), f"{factor.axis}_side"
        for row in rows:
            row[with_word(name, "set")] = along(row[factor.set_name], levels, nominal)
            if since in row:
                # a setting outside those of the run, such as that at rest, was not read: nothing is known there
                known_there = levels[0] <= row[start] <= levels[-1]
                read = along(row[start], levels, nominal) if known_there else math.nan
                row.update(zip(moves_of(name), (row[since], read), strict=True))
            if side in row:
                row[f"{stem_of(name)}_side"] = rises * row[side]
        replaced |= {of, since, start, side}
    for row in rows:
        for column in replaced & row.keys():
            del row[column]
    settings = {name: with_word(of, "set") for name, of in steered_of(bench).items()}
    return found | {name: column for name, column in settings.items() if any(column in row for row in rows)}


def setters_of(bench: Stored) -> dict[str, str]:
    """The instrument of every factor, see `BenchConfig.setters`."""
    own = bench.table("factors").texts()
    return own | {name: own[of] for name, of in steered_of(bench).items()}


def steered_of(bench: Stored) -> dict[str, str]:
    """Quantities that may have levels of their own, and the factor that sets each, see `BenchConfig.steered`."""
    tables = bench.table("references").tables()
    return {name: table.text("of") for name, table in tables if "approach" in table.everything()}


def _read_of(run_list: RunList, bench: Stored) -> Iterator[tuple[str, str]]:
    factors = {factor.name for factor in run_list.factors}
    for name, table in bench.table("references").tables():
        if (of := table.text("of")) in factors and name not in factors:
            yield name, of
