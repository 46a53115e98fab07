"""What the program asks of the kind "general"."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitter.effects.entry import Entry
from fitter.errors import FitError
from procedures.acceptance import Verdict
from procedures.advice import Advice
from procedures.charting import Charting
from procedures.errors import DataError
from procedures.expected import Columns, Expecting
from procedures.further_runs import Limits, Variation
from procedures.general.options import FitOptions, InferOptions, TraceOptions
from procedures.inference import Inference
from procedures.precision import Precision
from procedures.results import Compared, Fitted, Source, Traced
from procedures.run_list import RunList
from procedures.table import Reader, Table
from procedures.unused import Unused

if TYPE_CHECKING:
    from procedures.general.infer import CurveCalibration


class GeneralKind:
    """A table of anything, with a declared formula. See `procedures.kind.Kind`."""

    name = "general"
    title = "any table"
    settings = None
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    bench_factors: tuple[str, ...] = ()
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

    def calibration_of(self, given: Mapping[str, Any]) -> CurveCalibration:
        """See `Kind`."""
        from procedures.general.infer import CurveCalibration  # noqa: PLC0415

        if "calibration" not in given:
            raise FitError("it was written before tables of any kind could be inferred from; fit the table again")
        return CurveCalibration.from_dict(given["calibration"])

    def notes_of(self, given: Mapping[str, Any]) -> tuple[str, ...]:
        """As for a calibration with effects that a follow-up run confirmed; there is none."""
        return ()

    def infer(
        self, calibration: CurveCalibration, read: Reader, options: InferOptions, other: Callable[[Path], Reader]
    ) -> Inference:
        """The abscissa of the curve."""
        from procedures.general.infer_table import infer_general  # noqa: PLC0415

        return infer_general(calibration, read)

    def confirming(self, traced: Any) -> None:
        """Nothing of this kind is run on a bench."""

    def charting(self) -> Charting:
        """See `Kind`."""
        from procedures.general.charting import CHARTING  # noqa: PLC0415

        return CHARTING

    def expecting(self, calibration: CurveCalibration) -> Expecting:
        """A column of a table is no sensor of a bench."""
        raise FitError("it is of a table of any kind, which says nothing of what a bench's sensors should read")

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> None:
        """Nothing of this kind is run on a bench."""

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

    def compare(
        self,
        procedures: Sequence[Any],
        names: Sequence[str],
        axes: Collection[str],
        usage: float | None,
        hours: Sequence[float],
    ) -> Compared:
        """There is no figure of merit for these."""
        raise DataError(f"procedures of kind {self.name} are not compared")

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
