"""For how many readings in use an inferred value holds: those of the run, or another number by their scatter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rig.procedures.column_names import spelled, unit_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.inference import Inference
from rig.procedures.tables.within import Within

COLUMN = "mean_of_readings"
"""Column with the number of readings of which one in use is the mean."""
NOT_RECORDED = "as the rows of the calibration"
STATED = "as stated"


def scatter_of(output: str, within: Mapping[str, Within], count: float) -> Within:
    """Scatter of readings of an output inside points. Raises `DataError` if the run says none for this number."""
    one = within.get(output)
    if one is None:
        raise DataError(
            f"--readings {count:g}: the calibration does not say how the readings of {output} scatter inside a point: "
            f"fit the run file, or its whole export; of any other table --u-reading gives the standard uncertainty of "
            f"a reading in use"
        )
    if one.df == 0.0 and count != one.readings:
        raise DataError(
            f"--readings {count:g}: a point of the run was one reading of {output}, so that nothing is known of their "
            f"scatter inside a point: give one reading at a time, or its standard uncertainty with --u-reading"
        )
    return one


def in_use(found: Inference, within: Mapping[str, Within], count: float | None) -> Inference:
    """An inference that says for how many readings in use it holds: a column, and notes.

    Args:
        found: by the calibration for `count` readings.
        within: readings of the run, by output.
        count: number of readings in use; None for that of the run.
    """
    told = {
        quantity: STATED if quantity in found.stated else _count(found.outputs.get(quantity, ()), within, count)
        for quantity in found.quantities
    }
    rows = len(next(iter(found.columns.values())))
    same = len(set(told.values())) == 1
    named = {COLUMN: next(iter(told.values()))} if same else {f"{q}_{COLUMN}": one for q, one in told.items()}
    named = {name if name not in found.columns else f"inferred_{name}": one for name, one in named.items()}
    columns = {**found.columns, **{name: np.full(rows, one, dtype=object) for name, one in named.items()}}
    outputs = [name for quantity, every in found.outputs.items() if quantity not in found.stated for name in every]
    notes = list(_sentences(outputs, within, count))
    if count is None and any(one.df for name, one in within.items() if name in outputs):
        notes.append("--readings gives standard deviations and intervals for another number of readings")
    added = (*found.added, *named)
    return replace(found, columns=columns, added=added, notes=(*notes, *found.notes), readings=told)


def _count(outputs: Iterable[str], within: Mapping[str, Within], count: float | None) -> Any:
    """Number of readings; in words where it is not known, or differs between outputs."""
    every = tuple(outputs)
    if count is not None:
        return _number(count)
    known = {name: _number(within[name].readings) for name in every if name in within}
    if len(known) < len(every):
        return NOT_RECORDED
    if len(set(known.values())) == 1:
        return next(iter(known.values()))
    return ", ".join(f"{name} {n}" for name, n in known.items())


def _number(value: float) -> float | int:
    rounded = float(f"{value:.4g}")
    return int(rounded) if rounded.is_integer() else rounded


def as_in_run(outputs: Iterable[str], within: Mapping[str, Within]) -> Iterator[str]:
    """For which readings values inferred from these outputs hold in a budget, as sentences."""
    yield from _sentences(outputs, within, None)


def _sentences(outputs: Iterable[str], within: Mapping[str, Within], count: float | None) -> Iterator[str]:
    """A sentence on the outputs whose points have the same number of readings; the last on those of unknown ones."""
    every = list(dict.fromkeys(outputs))
    for mean in dict.fromkeys(_mean(within[name].readings) for name in every if name in within):
        same = [name for name in every if name in within and _mean(within[name].readings) == mean]
        whose = "" if len(same) == len(every) else f"{', '.join(same)}: "
        here = f"{mean}, as at each point of the run"
        if count is not None:
            here = f"{_mean(count)}; each point of the run has {mean}"
        known = {name: f"{within[name].sd:.3g} {spelled(unit_of(name))}".strip() for name in same if within[name].df}
        single = f". A single one scatters inside a point by {_listed(known)}" if known else ""
        yield f"{whose}inferred values hold for {here}{single}"
    if unknown := [name for name in every if name not in within]:
        yield (
            f"{', '.join(unknown)}: inferred values hold for readings in use that scatter as the rows of the "
            f"calibration do. Of how many readings a row is the mean, and how these scatter, is not recorded"
        )


def _listed(known: Mapping[str, str]) -> str:
    """Numbers, each with its output, if there are several."""
    if len(known) == 1:
        return next(iter(known.values()))
    return ", ".join(f"{size} ({name})" for name, size in known.items())


def _mean(count: float) -> str:
    return "one reading" if _number(count) == 1 else f"the mean of {_number(count)} readings"
