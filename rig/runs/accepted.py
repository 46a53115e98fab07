"""A complete run compared with the acceptance limits of its procedure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.errors import RigError, UsageError
from rig.procedures.errors import DataError
from rig.procedures.kind import Procedure
from rig.procedures.kinds import kind_of
from rig.procedures.present.blocks import Block, Line
from rig.run_file.read.reader import RunReader
from rig.runs.plans import has_plan, stored_plan

if TYPE_CHECKING:
    from rig.procedures.evaluate.acceptance import Verdict


@dataclass(frozen=True)
class Acceptance:
    """Result of the comparison.

    Attributes:
        verdicts: one per sensor; none without a limit.
        problem: why it cannot be judged; "" if it can.
    """

    verdicts: Sequence[Verdict] = ()
    problem: str = ""

    @classmethod
    def of(cls, procedure: Procedure, run_file: Path) -> Acceptance:
        """Acceptance of a complete run by the limits of a procedure. The fitter is loaded only if there are limits."""
        if not procedure.acceptance.limited:
            return cls()
        try:
            return cls(judge(procedure, run_file))
        except (RigError, DataError) as error:
            return cls(problem=str(error))

    @classmethod
    def of_run(cls, run_file: Path) -> Acceptance:
        """Acceptance of a complete run by the limits in its file."""
        try:
            with RunReader.open(run_file) as reader:
                if not has_plan(reader):
                    return cls()
                procedure = stored_plan(reader, run_file, None).procedure
        except (RigError, DataError) as error:
            return cls(problem=str(error))
        return cls.of(procedure, run_file)

    @property
    def outside(self) -> bool:
        """Whether a sensor is outside its limit, or the comparison is impossible."""
        return bool(self.problem) or any(not verdict.inside for verdict in self.verdicts)

    def blocks(self, indent: str = "") -> Iterator[Block]:
        """Lines for people; none without a limit."""
        if self.problem:
            yield Line(f"{indent}[red]acceptance cannot be judged:[/] {escape(self.problem)}")
        for one in self.verdicts:
            if not one.inside:
                yield Line(f"{indent}[red]{escape(one.sensor)} is outside acceptance:[/] {escape(one.found)}")
        if self.verdicts and not self.outside:
            yield Line(f"{indent}every sensor is inside acceptance ({self.verdicts[0].limit}):")
            for one in self.verdicts:
                yield Line(f"{indent}  {escape(one.sensor)}: {escape(one.found)}")

    def to_json(self) -> dict[str, Any] | None:
        """Values for JSON; None without a limit. `inside` is None if it cannot be judged."""
        if not self.verdicts and not self.problem:
            return None
        sensors = {one.sensor: {"inside": one.inside, "found": one.found, "limit": one.limit} for one in self.verdicts}
        return {"inside": None if self.problem else not self.outside, "problem": self.problem, "sensors": sensors}


def judge(procedure: Procedure, run_file: Path) -> Sequence[Verdict]:
    """Verdicts on every sensor of a complete run, by the procedure's limit; [] without a limit.

    Raises:
        RigError: the run cannot be fitted.
    """
    from rig.tables.table_of_run import run_table  # noqa: PLC0415 - few runs have limits

    try:
        return kind_of(procedure).judge(procedure, run_table(run_file))
    except DataError as error:
        raise UsageError(str(error)) from error
