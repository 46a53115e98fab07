"""Options of commands for whole-plot calibrations only."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from pydantic import Field

from rig.procedures.evaluate.results import QUICK, Options

_FORMULA = (
    "the declared model instead of the one that the run's procedure declares: full, II.C, eq10, hierarchical, or a "
    "formula such as '1 + P + P:T_sensor'"
)


class FitOptions(Options):
    """Options of `rig fit`."""

    formula: str | None = Field(None, description=_FORMULA)
    method: str | None = Field(
        None,
        description="by which method the calibration is kept: GLS, WLS, 'in-flight zero' or 'in-flight zero + WLS'",
        json_schema_extra={"default": "GLS"},
    )
    add: list[str] | None = Field(
        None, description="a further term, such as an effect that was traced: --add 'P^3'; repeatable"
    )
    power: float | None = Field(
        None,
        ge=0.0,
        le=10.0,
        description="weighted methods multiply rows by 1/P^POWER",
        json_schema_extra={"default": "1"},
    )
    exclude_zero: bool = Field(False, description="weighted methods leave out readings at zero pressure")


class TraceOptions(Options):
    """Options of `rig trace`."""

    formula: str | None = Field(None, description=_FORMULA)
    quick: bool = Field(False, description=QUICK)


class BudgetOptions(Options):
    """Options of `rig budget`."""

    traced: bool = Field(False, description="with the effects that a trace finds, and the model error they leave")
    formula: str | None = Field(None, description=_FORMULA)


class ZeroRowsMean(StrEnum):
    """Meaning of several rows read in vacuum."""

    ONE_SITTING = "one-sitting"
    INDEPENDENT = "independent"


class InferOptions(Options):
    """Options of `rig infer`."""

    zero: Path | None = Field(
        None,
        description="CSV of readings in vacuum, or near it with their pressure_psia, since temperatures last changed",
    )
    zero_rows: ZeroRowsMean | None = Field(
        None,
        description="what several rows read in vacuum are: of one sitting, which shares the whole-plot error of the "
        "readings; or independent, the temperatures set again before each; a column whole_plot says it too",
    )
