"""Options of commands for attitude calibrations only."""

from __future__ import annotations

from pydantic import Field

from rig.procedures.evaluate.results import QUICK, Options

_TEMPERATURE = "whether offset and sensitivity follow the sensor temperature in the declared model"
_AS_RUN = "as the run's procedure has it under [model], else not"


class FitOptions(Options):
    """Options of `rig fit`."""

    traced: bool = Field(False, description="keep a calibration with the effects that a trace finds")
    temperature: bool | None = Field(None, description=_TEMPERATURE, json_schema_extra={"default": _AS_RUN})
    at_degC: float | None = Field(
        None,
        description="with temperature: the sensor temperature at which parameters are given, such as 23",
        json_schema_extra={"default": "the mean of the run"},
    )
    points: str | None = Field(
        None,
        description="what fewer points would have cost: 'fraction' for several fractions of the grid, a number for "
        "the fraction of about that many points, 'tumble' for design T",
    )


class TraceOptions(Options):
    """Options of `rig trace`."""

    temperature: bool | None = Field(None, description=_TEMPERATURE, json_schema_extra={"default": _AS_RUN})
    unnamed: bool = Field(False, description="also fit smooth terms without a cause to what no effect explains")
    quick: bool = Field(False, description=QUICK)


class BudgetOptions(Options):
    """Options of `rig budget`."""

    traced: bool = Field(False, description="with the effects that a trace finds, and the model error they leave")
    temperature: bool | None = Field(None, description=_TEMPERATURE, json_schema_extra={"default": _AS_RUN})


class InferOptions(Options):
    """Options of `rig infer`."""

    roll: str | None = Field(None, description="column of roll measured otherwise, in degrees")
    roll_sd: float = Field(0.0, ge=0, description="standard deviation of the measured roll, deg")
    near: tuple[float, float] | None = Field(
        None,
        description="approximate pitch and roll, deg: --near 0 180 for a package upside down; level if not given",
    )
    sensors: str | None = Field(
        None,
        description="infer from these alone, as in --sensors x_V,y_V",
        json_schema_extra={"default": "all"},
    )
