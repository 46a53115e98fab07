"""A laboratory's own effects in tables of any kind (`rig.fitter.effects.own`).

Stratum "row", scope "sensor". Variables of columns are columns of the table: settings, covariates and the time. A table
without one of them is not tested for the effect, which is said.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.effects.own import Grammar
from rig.fitter.effects.own_formula import OwnFormula
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.general.effects.kind import TableEffect, TableKind
from rig.procedures.general.effects.scene import TableScene


class _AnyColumn(Collection[str]):
    """Names of columns of tables that are not yet known."""

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str)

    def __iter__(self) -> Iterator[str]:
        return iter(("columns of the table",))

    def __len__(self) -> int:
        return 1


def _terms(scene: TableScene, *_names: str, formulas: Sequence[OwnFormula]) -> Sequence[TableTerm]:
    """One block of all columns of the effect."""
    columns = np.column_stack([formula.column(scene.of, scene.n) for formula in formulas])
    return (TableTerm(tuple(formula.text for formula in formulas), columns),)


def missing_in(scene: TableScene, effect: TableEffect) -> tuple[str, ...]:
    """Variables of an own effect that the table does not have."""
    time = () if scene.time is None else (scene.time.name,)
    return tuple(name for name in effect.columns if name not in scene.variables and name not in time)


def _effect(fields: Mapping[str, Any], formulas: Sequence[OwnFormula]) -> TableEffect:
    names = tuple(sorted({name for formula in formulas for name in formula.used}))
    kind = TableKind(
        fields["name"],
        "own",
        "covariate",
        fields["cause"],
        "point-by-replication",
        fields["unit"],
        fields["separate_by"],
        fields["usual_size"],
        partial(_terms, formulas=formulas),
    )
    return TableEffect(
        **{**fields, "stratum": kind.stratum},
        source="covariate",
        against=names[0] if names else "",
        kind=kind,
        columns=names,
        family=kind.family,
    )


GRAMMAR = Grammar(("row",), ("sensor",), _AnyColumn(), _effect)
