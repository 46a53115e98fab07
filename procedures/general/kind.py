"""The kind "general"."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitter.effects.entry import Entry
from fitter.errors import FitError
from procedures.charting import Charting
from procedures.errors import DataError
from procedures.general.options import FitOptions, InferOptions, TraceOptions
from procedures.inference import Inference
from procedures.kind import Kind
from procedures.results import Fitted, Source, Traced
from procedures.seen import Seen
from procedures.table import Reader, Table

if TYPE_CHECKING:
    from procedures.general.infer import CurveCalibration


class GeneralKind(Kind):
    """Any table with a declared formula. See `procedures.kind.Kind`."""

    name = "general"
    title = "any table"
    fit_options, trace_options, infer_options = FitOptions, TraceOptions, InferOptions
    asked_by = frozenset({"response"})
    in_use = "the response's column; the fitted curve is inverted where it rises or falls all the way"
    described = "any other table is fitted with --response and --formula"

    def fit(
        self, source: Source, options: FitOptions, *, leave_out: Sequence[str], own: Sequence[Entry], keep: bool
    ) -> Fitted:
        """A formula to one column."""
        from procedures.general.declared import Declared  # noqa: PLC0415
        from procedures.general.fit import GeneralFitted, fit_general  # noqa: PLC0415
        from procedures.general.series import series_of  # noqa: PLC0415

        if options.response is None:
            raise DataError("--formula and --model need --response, the column to be explained")
        plots = [name.strip() for name in options.whole_plot.split(",")] if options.whole_plot else []
        declared = Declared(
            options.formula,
            options.model,
            options.abscissa,
            tuple(options.start or ()),
            options.weight,
            options.u_y,
            options.u_x,
            series_of(options.series, options.direction, options.position),
        )
        result = fit_general(
            source.read, options.response, None, plots, options.replicate, leave_out, declared, options.tolerance
        )
        return GeneralFitted(result)

    def trace(self, source: Source, options: TraceOptions, *, own: Sequence[Entry]) -> Traced:
        """See `Kind`."""
        from procedures.general.column_roles import Roles  # noqa: PLC0415
        from procedures.general.evaluate import trace_general_table  # noqa: PLC0415

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
            date=options.date,
            date_order=options.date_order,
        )
        return trace_general_table(source.read, roles)

    def look(self, source: Source, table: Table) -> Seen | None:
        """See `Kind`."""
        from procedures.general.likely import likely  # noqa: PLC0415

        return likely(source, table)

    def calibration_of(self, given: Mapping[str, Any]) -> CurveCalibration:
        """See `Kind`."""
        from procedures.general.infer import CurveCalibration  # noqa: PLC0415

        if "calibration" not in given:
            raise FitError("it was written before tables of any kind could be inferred from; fit the table again")
        return CurveCalibration.from_dict(given["calibration"])

    def infer(
        self, calibration: CurveCalibration, read: Reader, options: InferOptions, other: Callable[[Path], Reader]
    ) -> Inference:
        """The abscissa of the curve."""
        from procedures.general.infer_table import infer_general  # noqa: PLC0415

        return infer_general(calibration, read, options.u_reading)

    def charting(self) -> Charting:
        """See `Kind`."""
        from procedures.general.charting import CHARTING  # noqa: PLC0415

        return CHARTING


def _names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, each with one or several names separated by commas."""
    return tuple(name for text in given or () for part in text.split(",") if (name := part.strip()))


KIND = GeneralKind()
