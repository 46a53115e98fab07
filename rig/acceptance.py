"""Whether a finished calibration is fit for use, by the acceptance limits of its procedure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from procedures.acceptance import Verdict
from procedures.errors import DataError
from procedures.kind import Procedure, kind_of
from rig.errors import UsageError
from rig.tables import run_table


def judge(procedure: Procedure, path: Path) -> Sequence[Verdict]:
    """Verdicts on every sensor of a complete run, by the procedure's limit; [] without a limit.

    Raises:
        RigError: the run cannot be fitted.
    """
    try:
        return kind_of(procedure).judge(procedure, run_table(path))
    except DataError as error:
        raise UsageError(str(error)) from error
