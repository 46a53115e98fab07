"""What the program asks of the kind "whole-plot"."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property

from fitter.effects.own import Grammar
from fitter.errors import FitError
from procedures.acceptance import Verdict
from procedures.advice import Advice
from procedures.further_runs import Limits, Variation
from procedures.precision import Precision
from procedures.pressure.settings import WholePlotProcedure
from procedures.run_list import RunList
from procedures.table import Table


class PressureKind:
    """Pressure transducers in temperature whole plots. See `procedures.kind.Kind`."""

    name = "whole-plot"
    settings = WholePlotProcedure

    @cached_property
    def own_effects(self) -> Grammar:
        """See `Kind`."""
        from procedures.pressure.effects.own import GRAMMAR  # noqa: PLC0415

        return GRAMMAR

    def recognises(self, columns: Collection[str]) -> bool:
        """By columns that no other kind has."""
        return bool({"whole_plot", "pressure_psia"} & set(columns))

    def check_design(self, procedure: WholePlotProcedure, run_list: RunList) -> None:
        """Whether the design can estimate the declared model, and acceptance can be judged."""
        from procedures.pressure.declared import check_declared

        check_declared(procedure, run_list)

    def precision(self, procedure: WholePlotProcedure, run_list: RunList) -> Precision:
        """Of each term of the declared model."""
        from procedures.pressure.precision import precision

        try:
            return precision(procedure, run_list)
        except FitError as error:
            raise FitError(f"{error}; or plan a smaller model ([model] formula)") from error

    def advice(self, procedure: WholePlotProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """The paper has no recommendations."""
        if usage_deg is not None:
            raise FitError(f"--usage is for attitude sensors; this procedure is of kind {self.name}")
        return ()

    def judge(self, procedure: WholePlotProcedure, table: Table) -> Sequence[Verdict]:
        """See `Kind`."""
        from procedures.pressure.acceptance import judge  # noqa: PLC0415

        return judge(procedure, table)

    def further_runs(self, procedure: WholePlotProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """See `Kind`."""
        from procedures.pressure.further_runs import further_runs

        return further_runs(procedure)


KIND = PressureKind()
