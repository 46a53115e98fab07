"""Options of commands for attitude calibrations only."""

from __future__ import annotations

from pydantic import Field

from rig.procedures.evaluate.results import Options

_TEMPERATURE = "whether offset and sensitivity follow the sensor temperature in the declared model"
_AS_RUN = "as the run's procedure has it under [model], else not"


class FitOptions(Options):
    """Options of `rig fit`."""

    traced: bool = Field(False, description="keep a calibration with the effects that a trace finds")
    temperature: bool | None = Field(None, description=_TEMPERATURE, json_schema_extra={"default": _AS_RUN})
    at_degC: float | None = Field(
        None,
        description="with temperature: the sensor temperature at which parameters are given, 20 or 23 say",
        json_schema_extra={"default": "the mean of the run"},
    )
    points: str | None = Field(
        None,
        description="what fewer points would have cost: 'fraction' for a family of fractions of the grid, a number for "
        "the one with about so many points, 'tumble' for design T",
    )


class TraceOptions(Options):
    """Options of `rig trace`."""

    temperature: bool | None = Field(None, description=_TEMPERATURE, json_schema_extra={"default": _AS_RUN})
    unnamed: bool = Field(False, description="let smooth terms without a cause take up what no effect explains")


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
        description="pitch and roll, deg, on the side where the package is, as in --near 0 180 for one upside down; "
        "level if not given",
    )
    sensors: str | None = Field(
        None,
        description="infer from these alone, as in --sensors x_V,y_V",
        json_schema_extra={"default": "all"},
    )
