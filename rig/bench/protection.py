"""Protection of a bench in its file: `[interlocks.NAME]` and `[safety]`."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from rig.units.of_instruments import HEAD, PRESSURE

STATES = {"alarms": "empty", "running": "flag", "temperature_degC": "number", "setpoint_degC": "number"}
"""Quantities of a chamber that an interlock can watch, with their types."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class InterlockConfig(_Strict):
    """One `[interlocks.NAME]` table: a condition that must hold at all times.

    A chamber that reports an alarm is brought to its safe state also without an interlock.
    """

    watch: str = Field(
        min_length=1,
        description="CHAMBER.alarms, CHAMBER.running, CHAMBER.temperature_degC, CHAMBER.setpoint_degC; an axis "
        f"readback ({', '.join((*HEAD, PRESSURE))}, or a factor under [factors]); or a temperature column",
    )
    within: tuple[float, float] | None = Field(None, description="permitted range of a number, ends included")
    must_be: bool | None = Field(None, description="required value of CHAMBER.running")
    for_s: float = Field(0.0, ge=0, le=86400, description="violated only after this time without interruption")
    then: Literal["safe", "hold"] = Field(
        "safe", description="safe: safe state and exit code 1, resumable; hold: wait for a person"
    )
    why: str = Field("", max_length=200, description="what a person should check; shown in the message")

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
    """The safe state and its time limit: motion stopped, pressure vented, chambers at ambient."""

    within_s: float = Field(
        300.0, gt=0, le=86400, description="time limit for all instruments; failed steps are repeated"
    )
    ambient_degC: tuple[float, float] = Field(
        (10.0, 40.0), description="permitted setpoints of chambers in the safe state; read back"
    )
    ambient_psia: tuple[float, float] = Field(
        (8.0, 17.0), description="pressure of a vented line; read back in the safe state"
    )

    on_stop: Literal["hold", "off"] | dict[str, Literal["hold", "off"]] = Field(
        "hold",
        description="outputs at an interruption (SIGINT, SIGTERM, SIGHUP): hold, they stay on; off, safe state of the "
        "instrument; for all, or a table by instrument. All other ends bring every instrument to its safe state",
    )

    def switched_off(self, instrument: str) -> bool:
        """Whether an interruption brings an instrument to its safe state."""
        return (self.on_stop if isinstance(self.on_stop, str) else self.on_stop.get(instrument)) == "off"

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for name, (low, high) in (("ambient_degC", self.ambient_degC), ("ambient_psia", self.ambient_psia)):
            if not low < high:
                raise ValueError(f"{name}: {low:g} is not below {high:g}")
        return self
