"""What an instrument of a file does: it measures, or it sets one quantity; and how it is known that it was off."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from rig.contracts.declared.exchanges import Ask, Check, Strict, Tells
from rig.contracts.declared.forms import Form

Unit = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9]*(_per_[A-Za-z][A-Za-z0-9]*)?$")]
Treated = Literal["accept", "wait", "refuse"]


class Mark(Strict):
    """A setting without effect that power-off clears: how it is known that the power was off."""

    tell: Tells = Field(description="commands that set it")
    check: Check = Field(description="question for it, with the answer while it is set")


class Channel(Strict):
    """One channel of a reader."""

    is_: str = Field("", alias="is", description="what stands for {channel}; left out: its name")
    unit: Unit | None = Field(None, description="unit of its readings; left out: the reader's")
    field: str = Field("value", description="field of the answer that has its reading")
    reading: Ask | None = Field(None, description="question for its reading; left out: the reader's")


class Reader(Strict):
    """It measures."""

    unit: Unit | None = Field(None, description="unit of its readings, as at the end of column names")
    reading: Ask | None = Field(None, description="question that takes a reading; of a stream: the form of its lines")
    channels: dict[str, Channel] = Field({}, description="its channels; left out: one, `input`")
    select: Tells = Field((), description="commands that choose a channel")
    settle_s: float = Field(0.0, ge=0, le=3600, description="wait after choosing")
    discard: int = Field(0, ge=0, le=100, description="readings that are not used after choosing")
    confirm: Ask | None = Field(
        None,
        description="question before each reading: for the channel chosen, {channel}; an older answer then shows",
    )
    start: Tells = Field((), description="starts {count} readings, which it keeps")
    fetch: Ask | None = Field(
        None, description="with start: asks for them, answer with {values}, or {value} if most is 1"
    )
    number: Tells = Field((), description="gives the next readings a number, {mark}, which the answer repeats")
    abort: Tells = Field((), description="gives up a measurement")
    reading_s: float = Field(0.0, ge=0, le=600, description="time that a reading takes")
    most: int = Field(10000, ge=1, le=1_000_000, description="largest number of readings at once")
    overload: float = Field(1e30, gt=0, description="readings of this size or larger are outside its range")
    unstable: Treated = Field("wait", description="a reading that is called unstable: accept, wait, refuse")
    patience_s: float = Field(60.0, ge=0, le=3600, description="longest wait for a stable one")
    again_s: float = Field(0.5, ge=0, le=60, description="time until it is asked again")
    resolution: float = Field(0.0, ge=0, description="smallest step of its readings; 0: finer than its noise")
    noise: float = Field(1e-6, ge=0, description="noise of the twin, standard deviation of a reading")


_SWITCHED = {"1": "on", "0": "off", "ON": "on", "OFF": "off"}
_ARRIVED = {"1": "stable", "0": "unstable"}


class Source(Strict):
    """It sets one quantity: a bath, a chamber, a calibrator, a flow controller, a pressure controller."""

    unit: Unit | None = Field(None, description="its unit, as at the end of column names")
    low: float | None = Field(None, description="lowest accepted setpoint")
    high: float | None = Field(None, description="highest accepted setpoint")
    set: Tells = Field((), description="sets {value}; the last command may carry a sequence out")
    setpoint: Ask | None = Field(None, description="asks for the setpoint in force; left out: it cannot be asked")
    readback: float | None = Field(None, gt=0, description="largest difference of setpoint and its answer")
    read: Ask | None = Field(None, description="asks for its own reading; left out: it has none")
    read_off: bool = Field(True, description="whether it gives a reading with the output off")
    on: Tells = Field((), description="switches on; left out: it is always on")
    off: Tells = Field((), description="switches off, or vents: the safe state, a sequence; `output` reads it back")
    output: Ask | None = Field(
        None, description="asks whether it is on, off, or vents; 1 and ON, 0 and OFF need no words"
    )
    rest: tuple[float, float] | None = Field(
        None, description="lowest and highest reading of what is off: a vent takes time, and is not safe before"
    )
    safe_value: float | None = Field(None, description="setpoint of the safe state")
    hold: Tells = Field((), description="holds the present value; left out: it becomes the setpoint")
    settled: Ask | None = Field(None, description="asks whether it has arrived: words, or a bit")
    settled_after_s: float = Field(0.0, ge=0, le=3600, description="what settled says sooner is of the setpoint before")
    tolerance: float | None = Field(
        None, gt=0, description="largest distance of reading and setpoint; with settled: then, too"
    )
    dwell_s: float = Field(1.0, ge=0, le=86400, description="time that it has been so, or since it was set")
    time_constant_s: float | None = Field(None, gt=0, le=1e6, description="how it approaches a setting, for forecasts")

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, given: Any) -> Any:
        """Numbers and words that need no explanation."""
        if not isinstance(given, dict):
            return given
        found = dict(given)
        for key, words in (("output", _SWITCHED), ("settled", _ARRIVED)):
            one = {"ask": given[key]} if isinstance(given.get(key), str) else given.get(key)
            if isinstance(one, dict) and not one.keys() & {"answer", "words", "bit", "off_bit"}:
                found[key] = {**one, "words": words}
        return found

    @property
    def step(self) -> float:
        """Step of setpoints on the wire; 0 if it is finer than any."""
        for one in self.set:
            if one.tell is not None:
                field = Form(one.tell).fields.get("value")
                if field is not None and (field.decimals >= 0 or field.kind in ("d", "x")) and field.kind[:1] != "e":
                    return abs(one.scale) * 10.0 ** -max(field.decimals, 0)
            elif one.value is None and one.type != "float32":
                unknown = one.decimals is not None or (one.type is None and one.scale == 1.0)
                return 0.0 if unknown else abs(one.scale)
        return 0.0

    @property
    def nearness(self) -> float:
        """Largest difference of setpoint and its answer."""
        return self.readback or max(self.step * 0.5000001, 1e-6 * max(abs(self.low or 0.0), abs(self.high or 0.0), 1.0))
