"""What the program asks of the kind "acme-tilt"."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from acme_rig.tilt.settings import TiltProcedure
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Entry
from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict
from rig.procedures.evaluate.inference import Inference
from rig.procedures.evaluate.results import Fitted, Options, Source, Traced
from rig.procedures.kind import Kind
from rig.procedures.plan.expected import Columns
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import Unused

if TYPE_CHECKING:
    from acme_rig.tilt.fit import Line


class TiltOptions(Options):
    """Of `rig fit` and `rig trace`."""

    tilt: bool = Field(False, description="take a table for that of a level sensor on the pitch axis")


class TiltKind(Kind):
    """A level sensor on the pitch axis. See `rig.procedures.kind.Kind`."""

    name = "acme-tilt"
    title = "level sensors"
    settings = TiltProcedure
    described = "a level table has replicate,order,elapsed_s,pitch_deg,pitch_side and NAME_V, and needs --tilt"
    in_use = "the output of one level sensor"
    fit_options = trace_options = TiltOptions
    asked_by = frozenset({"tilt"})

    def fit(
        self, source: Source, options: TiltOptions, *, leave_out: Sequence[str], own: Sequence[Entry], keep: bool
    ) -> Fitted:
        """A straight line for every sensor."""
        from acme_rig.tilt.fit import fit

        if leave_out:
            raise DataError(f"--leave-out is not for {self.title}")
        return fit(source.table, self.name)

    def trace(self, source: Source, options: TiltOptions, *, own: Sequence[Entry]) -> Traced:
        """Hysteresis and drift."""
        from acme_rig.tilt.trace import trace

        return trace(source.table, self.name)

    def calibration_of(self, given: Mapping[str, Any]) -> Mapping[str, Line]:
        """A line for every sensor."""
        from acme_rig.tilt.fit import Line

        return {name: Line.of_json(one) for name, one in given["sensors"].items()}

    def infer(
        self, calibration: Mapping[str, Line], read: Reader, options: Options, other: Callable[[Path], Reader]
    ) -> Inference:
        """Pitch."""
        from acme_rig.tilt.fit import infer

        return infer(calibration, read)

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> FloatArray:
        """What the page fits while a run goes on."""
        from acme_rig.tilt.fit import columns as of_line

        return of_line(columns["pitch_deg"])

    def judge(self, procedure: TiltProcedure, table: Table) -> Sequence[Verdict]:
        """By the standard error of one observation."""
        from acme_rig.tilt.fit import fit, judge

        return judge(procedure.acceptance.sigma_deg, fit(table, self.name))

    def unused(self, table: Table) -> Unused:
        """What is neither output nor needed."""
        from acme_rig.tilt.fit import unused

        return unused(table)


KIND = TiltKind()
