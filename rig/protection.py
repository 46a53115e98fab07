"""What a bench file says about protecting itself: `[interlocks.NAME]` and `[safety]`."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from rig.quantities import HEAD, PRESSURE

STATES = {"alarms": "empty", "running": "flag", "temperature_degC": "number", "setpoint_degC": "number"}
"""What can be watched of a chamber, and of which kind it is."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class InterlockConfig(_Strict):
    """One `[interlocks.NAME]` table: something that must hold whatever the procedure does.

    A chamber that reports an alarm is brought to its safe state also without an interlock.
    """

    watch: str = Field(
        min_length=1,
        description="CHAMBER.alarms, CHAMBER.running, CHAMBER.temperature_degC, CHAMBER.setpoint_degC; an axis "
        f"readback ({', '.join((*HEAD, PRESSURE))}); or a temperature column",
    )
    within: tuple[float, float] | None = Field(None, description="a number must be in here, ends included")
    must_be: bool | None = Field(None, description="CHAMBER.running must be this")
    for_s: float = Field(0.0, ge=0, le=86400, description="violated only after this long without a break")
    then: Literal["safe", "hold"] = Field(
        "safe", description="safe: safe state and exit code 1, resumable; hold: wait for a person"
    )
    why: str = Field("", max_length=200, description="what a person should look at; said in the message")

    @model_validator(mode="after")
    def _rule_fits(self) -> Self:
        kind = STATES.get(self.watch.rpartition(".")[2], "number") if "." in self.watch else "number"
        if (self.within is not None) != (kind == "number"):
            raise ValueError(f"{self.watch} {'needs' if kind == 'number' else 'does not use'} within = [low, high]")
        if (self.must_be is not None) != (kind == "flag"):
            raise ValueError(f"{self.watch} {'needs' if kind == 'flag' else 'does not use'} must_be = true or false")
        if self.within is not None and not self.within[0] < self.within[1]:
            raise ValueError(f"within: {self.within[0]:g} is not below {self.within[1]:g}")
        return self


class SafetyConfig(_Strict):
    """What the safe state is and how soon it is reached: motion stopped, pressure vented, chambers at ambient."""

    within_s: float = Field(
        300.0, gt=0, le=86400, description="seconds in which every instrument is to be safe; what fails is tried again"
    )
    ambient_degC: tuple[float, float] = Field(
        (10.0, 40.0), description="a chamber's setpoint in here is no extreme; read back in the safe state"
    )
    ambient_psia: tuple[float, float] = Field(
        (8.0, 17.0), description="a line in here is vented; read back in the safe state"
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for name, (low, high) in (("ambient_degC", self.ambient_degC), ("ambient_psia", self.ambient_psia)):
            if not low < high:
                raise ValueError(f"{name}: {low:g} is not below {high:g}")
        return self
