"""Options of a Druck PACE pressure controller in the bench file."""

from __future__ import annotations

from importlib.resources import files
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from rig.drivers.declared import driver_of

Positive = Annotated[float, Field(gt=0)]


FILE: Any = driver_of(files("rig.drivers").joinpath("druck_pace.toml").read_text(encoding="utf-8"), own=False)
"""The class of its file: identity, errors, mark, line."""


class PaceOptions(FILE.Options):  # type: ignore[misc]  # made of its file
    """Options of this instrument in the bench file."""

    slew_psi_per_s: Positive = Field(0.1, description="rate of pressure changes")
    vent_psi_per_s: Positive = Field(0.2, description="rate of venting to the atmosphere")
    in_limits_pct_fs: Annotated[float, Field(gt=0, le=100)] = Field(
        0.01, description="in-limits band, percent of full scale"
    )
    in_limits_s: Annotated[int, Field(ge=2, le=999)] = Field(2, description="minimum time in the band")
    low_psia: float = Field(0.0, ge=0, description="lowest permitted setpoint")
    high_psia: float = Field(15.0, description="highest permitted setpoint")
    reference: Literal["absolute", "gauge"] = Field(
        "absolute", description="reference of its pressures; for gauge the barometer's reading is added"
    )
    ambient_psia: Annotated[float, Field(gt=0)] = Field(
        14.7, description="pressure of the atmosphere, if it has no barometer; then required for gauge"
    )
    control_range: str | None = Field(None, description="name of the control range; default: the selected one")
    module: Literal[1, 2] = Field(1, description="control module; 2 only in a PACE6000")
    timeout_s: Positive = Field(2.0, description="maximum wait for a reply")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low_psia >= self.high_psia:
            raise ValueError("low_psia must be below high_psia")
        return self
