"""What the program asks of the kind "whole-plot"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fitter.errors import FitError
from procedures.advice import Advice
from procedures.further_runs import Limits, Variation
from procedures.precision import Precision
from procedures.pressure.settings import WholePlotProcedure
from procedures.run_list import RunList


class PressureKind:
    """Pressure transducers in temperature whole plots. See `procedures.kind.Kind`."""

    name = "whole-plot"
    settings = WholePlotProcedure

    def check_design(self, procedure: WholePlotProcedure, run_list: RunList) -> None:
        """Whether the design can estimate the declared model, and acceptance can be judged."""
        from procedures.pressure.declared import check_declared  # noqa: PLC0415

        check_declared(procedure, run_list)

    def precision(self, procedure: WholePlotProcedure, run_list: RunList) -> Precision:
        """Of each term of the declared model."""
        from procedures.pressure.precision import precision  # noqa: PLC0415

        try:
            return precision(procedure, run_list)
        except FitError as error:
            raise FitError(f"{error}; or plan a smaller model ([model] formula)") from error

    def advice(self, procedure: WholePlotProcedure, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """The paper has no recommendations."""
        if usage_deg is not None:
            raise FitError(f"--usage is for attitude sensors; this procedure is of kind {self.name}")
        return ()

    def further_runs(self, procedure: WholePlotProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """See `Kind`."""
        from procedures.pressure.further_runs import further_runs  # noqa: PLC0415

        return further_runs(procedure)


KIND = PressureKind()
