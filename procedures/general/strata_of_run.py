"""Series and replications of a run, and sentences about what they have in common."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.strata import DIFFER, Strata
from rig.procedures.column_names import stem_of, with_word
from rig.procedures.evaluate.reversibility import in_words
from rig.procedures.tables.table import Table


def in_time(table: Table) -> IntArray:
    """(n,) rows in order of time."""
    given = table.columns.get("elapsed_s", np.arange(len(table)))
    return np.asarray(np.argsort(given, kind="stable"), np.int64)


def replication_of(table: Table) -> IntArray:
    """(n,) number of the replication of each row, from 0."""
    given = table.columns.get("replicate", np.zeros(len(table)))
    return np.asarray(np.unique(given, return_inverse=True)[1], np.int64)


def side_of(table: Table) -> FloatArray:
    """(n,) +1 where the one factor with sides was approached from below, -1 from above, 0 where nobody knows.

    With several such factors there are no series of one of them.
    """
    sides = [table.columns[name] for name in (f"{stem_of(one)}_side" for one in table.factors) if name in table.columns]
    moved = [one for one in sides if len(np.unique(one[one != 0.0])) > 1]
    return np.asarray(np.sign(moved[0]), np.float64) if len(moved) == 1 else np.zeros(len(table))


def points_of(table: Table) -> IntArray:
    """(n,) number of the combination of settings of each row, from 0."""
    number = [setting_of(table, name) for name in table.factors]
    every = np.column_stack(number) if number else np.arange(len(table))[:, None]
    return np.asarray(np.unique(every, axis=0, return_inverse=True)[1], np.int64).ravel()


def setting_of(table: Table, name: str) -> IntArray:
    """(n,) number of the setting of a factor, from 0."""
    given = table.columns.get(with_word(name, "set"), table.columns[name])
    return np.asarray(np.unique(np.round(given, 9), return_inverse=True)[1], np.int64)


def told_of(name: str, found: Strata) -> Iterator[str]:
    """Sentences about the degrees of freedom of type A, about series, and about what agrees too well to be chance."""
    test = found.between
    against = f"F = {test.value:.3g} with {test.df_above} and {test.df_below} degrees of freedom, p = {test.p:.2g}"
    if found.differ:
        yield (
            f"{name}: replications differ by more than the scatter inside them ({against}): type A is by the results "
            f"of {found.replications} replications, with at most {found.replications - 1} degrees of freedom (JCGM "
            f"100, 4.2.3)"
        )
    elif found.replications > 1:
        yield (
            f"{name}: {found.replications} replications differ by no more than the scatter inside them ({against}, "
            f"level {DIFFER:g}): type A is of all rows, pooled, with {found.df:.3g} degrees of freedom"
        )
    if found.correlation:
        yield (
            f"{name}: neighbours in time depend on each other (correlation {found.correlation:.2f}): type A counts "
            f"that, with {found.df:.2g} effective degrees of freedom"
        )
    if found.too_good < 1.0:
        yield (
            f"{name}: replications agree too well to be chance beside the scatter inside them (probability "
            f"{found.too_good:.1g} of so small an F): what is called scatter repeats, so the model lacks it (rig trace)"
        )
    if found.reversed is not None:
        yield in_words(name, found.sides)
