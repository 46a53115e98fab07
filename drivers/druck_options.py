"""What the bench file may say about a Druck PACE pressure controller."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from drivers.wires import SerialOptions

Positive = Annotated[float, Field(gt=0)]


class PaceOptions(SerialOptions):
    """What the bench file may say about this instrument."""

    slew_psi_per_s: Positive = Field(0.1, description="how fast pressure is changed")
    vent_psi_per_s: Positive = Field(0.2, description="how fast it goes to the atmosphere")
    in_limits_pct_fs: Annotated[float, Field(gt=0, le=100)] = Field(
        0.01, description="band in which it calls the pressure settled, percent of full scale"
    )
    in_limits_s: Annotated[int, Field(ge=2, le=999)] = Field(2, description="and for how long")
    low_psia: float = Field(0.0, ge=0, description="lowest setpoint that may be commanded")
    high_psia: float = Field(15.0, description="highest setpoint that may be commanded")
    reference: Literal["absolute", "gauge"] = Field(
        "absolute", description="what its pressures are counted from; gauge adds the barometer's"
    )
    ambient_psia: Annotated[float, Field(gt=0)] = Field(
        14.7, description="pressure of the atmosphere, where it has no barometer; gauge then needs it said"
    )
    control_range: str | None = Field(None, description="control range by its name; the one selected if not given")
    module: Literal[1, 2] = Field(1, description="control module; 2 only in a PACE6000")
    baud: Literal[2400, 4800, 9600, 19200, 38400, 57600, 115200] = Field(9600, description="symbols per second")
    frame: Literal["8N1", "7E1", "7O1", "8E1", "8O1"] = Field("8N1", description="data bits, parity, stop bits")
    timeout_s: Positive = Field(2.0, description="wait for a reply")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low_psia >= self.high_psia:
            raise ValueError("low_psia must be below high_psia")
        return self
