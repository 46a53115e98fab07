"""What the program asks of the kind "general"."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

from fitter.effects.entry import Entry
from procedures.acceptance import Verdict
from procedures.advice import Advice
from procedures.errors import DataError
from procedures.further_runs import Limits, Variation
from procedures.general.options import FitOptions, TraceOptions
from procedures.precision import Precision
from procedures.results import Fitted, Source, Traced
from procedures.run_list import RunList
from procedures.table import Table
from procedures.unused import Unused


class GeneralKind:
    """A table of anything, with a declared formula. See `procedures.kind.Kind`."""

    name = "general"
    title = "any table"
    settings = None
    fit_options, trace_options = FitOptions, TraceOptions
    asked_by = frozenset({"response"})
    described = "any other table is fitted with --response and --formula"
    own_effects = None

    def recognises(self, columns: Collection[str]) -> bool:
        """A table does not say by itself which column is explained: options do."""
        return False

    def fit(
        self, source: Source, options: FitOptions, *, leave_out: Sequence[str], own: Sequence[Entry], keep: bool
    ) -> Fitted:
        """A formula to one column."""
        from procedures.general.fit import GeneralFitted, fit_general  # noqa: PLC0415

        if options.response is None or options.formula is None:
            raise DataError("--response needs --formula, such as --formula '1 + x'")
        plots = [name.strip() for name in options.whole_plot.split(",")] if options.whole_plot else []
        result = fit_general(source.read, options.response, options.formula, plots, options.replicate, leave_out)
        return GeneralFitted(result)

    def trace(self, source: Source, options: TraceOptions, *, own: Sequence[Entry]) -> Traced:
        """See `Kind`."""
        from procedures.general.evaluate import trace_general_table  # noqa: PLC0415
        from procedures.general.roles import Roles  # noqa: PLC0415

        if options.response is None or options.formula is None:
            raise DataError("--response needs --formula, the declared model, such as --formula '1 + x'")
        roles = Roles(
            options.response,
            options.formula,
            group=_names(options.group),
            whole_plot=_names([options.whole_plot] if options.whole_plot else None),
            replicate=options.replicate,
            time=options.time,
            direction=options.direction,
            candidates=None if options.candidates is None else _names(options.candidates),
            ignore=_names(options.ignore),
            wrap=options.wrap,
        )
        return trace_general_table(source.read, roles)

    def unused(self, table: Table) -> Unused:
        """Fits and traces say it themselves: it depends on the formula."""
        return Unused()

    def check_design(self, procedure: Any, run_list: RunList) -> None:
        """Nothing of this kind is run on a bench."""

    def precision(self, procedure: Any, run_list: RunList) -> Precision:
        """Nothing of this kind is run on a bench."""
        raise NotImplementedError

    def advice(self, procedure: Any, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """There is none."""
        return ()

    def judge(self, procedure: Any, table: Table) -> Sequence[Verdict]:
        """No limits are set for it."""
        return ()

    def further_runs(self, procedure: Any, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """Nothing of this kind is run on a bench."""
        return iter(())


def _names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, each of which may hold several with commas between."""
    return tuple(name for text in given or () for part in text.split(",") if (name := part.strip()))


KIND = GeneralKind()
