"""Whether a finished calibration is fit for use, by the limits its procedure set beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from procedures.acceptance import Verdict
from procedures.errors import DataError
from procedures.kind import Procedure, kind_of
from rig.errors import UsageError
from rig.tables import run_table


def judge(procedure: Procedure, path: Path) -> Sequence[Verdict]:
    """Every sensor of a complete run against the procedure's limit; [] where there is none.

    Raises:
        RigError: the run cannot be fitted.

    """
    try:
        return kind_of(procedure).judge(procedure, run_table(path))
    except DataError as error:
        raise UsageError(str(error)) from error
