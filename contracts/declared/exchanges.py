"""One question or one command of a declared instrument: a line of text, or a register."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

Kind = Literal["int16", "uint16", "int32", "uint32", "float32", "bit"]
Table = Literal["holding", "input", "coil", "discrete"]
MEANINGS = ("stable", "unstable", "busy", "overload", "error", "on", "off", "vent")
"""Meanings of a word, a number or a bit of an answer; `error: TEXT` says which."""


class Strict(BaseModel):
    """A table without other keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


def _several(value: Any) -> Any:
    return [value] if isinstance(value, str | dict) else value


Texts = Annotated[tuple[str, ...], BeforeValidator(_several)]
"""A text, or a list of them."""


class Register(Strict):
    """Common part of a question and a command: where a number is, and how it is written."""

    register_: int | None = Field(None, alias="register", ge=0, le=65535, description="number of the (first) register")
    table: Table = Field("holding", description="which registers: holding, input, coil or discrete")
    type: Kind | None = Field(None, description="type of the number; left out: that of the wire")
    scale: float = Field(1.0, description="a number times this, plus offset, is the quantity in its unit")
    offset: float = Field(0.0, description="see scale")
    decimals: Annotated[int, Field(ge=0, le=65535)] | str | None = Field(
        None, description="register, or field of the answer, that says how many decimals it has"
    )
    places: dict[str, int] = Field(
        {}, description="number of decimals by what that holds, if it is a code: `{ 0 = 3, 1 = 2 }`"
    )
    signed: bool = Field(False, description="a hexadecimal number is a two's complement of its width")
    frame: str | None = Field(None, description="frame of this line, if it is not that of `request` of the wire")

    def shown(self, value: float) -> float:
        """A quantity as the number on the wire."""
        return (value - self.offset) / self.scale

    def places_of(self, said: float) -> int:
        """Number of decimals by what the register or field of `decimals` holds. Raises `ValueError` if it is none."""
        known = {float(code): places for code, places in self.places.items()}
        found = known.get(said) if known else int(said) if said in range(10) else None
        if found is None:
            wanted = f"one of its places, {', '.join(self.places)}" if known else "a number of decimals"
            raise ValueError(f"{self.decimals} should be {wanted}, and is {said:g}")
        return found

    def quantity(self, number: float) -> float:
        """A number on the wire as quantity."""
        return number * self.scale + self.offset if self.scale != 1.0 or self.offset else number


class Ask(Register):
    """A question and its answer. A text alone is a question whose answer is a number."""

    ask: str | None = Field(
        None,
        description="the line of a question; {channel} and parameters are filled in; can: a signal, MESSAGE.SIGNAL",
    )
    request: str | None = Field(None, description="can: what is sent to get it, as a command; or `remote`")
    status: str | None = Field(None, description="can: signal whose words say whether it counts")
    answer: Texts = Field((), description="forms of its answer; left out: `{value}`, or `{state}` if it has words")
    words: dict[str, str] = Field(
        {}, description="words, or numbers, in its answer: stable, unstable, busy, overload, error, on, off or vent"
    )
    field: str = Field("value", description="field of its answer that has its number")
    bit: int | None = Field(None, ge=0, le=31, description="the bit of its number that means yes; 0 is the lowest")
    off_bit: int | None = Field(None, ge=0, le=31, description="the bit that means no, in place of one that means yes")
    timeout_s: float | None = Field(None, gt=0, le=600, description="longest wait for its answer; left out: the wire's")
    lines: int = Field(1, ge=1, le=20, description="lines of its answer, which are joined by a space")

    @model_validator(mode="before")
    @classmethod
    def _short(cls, given: Any) -> Any:
        return {"ask": given} if isinstance(given, str) else given

    @property
    def forms(self) -> tuple[str, ...]:
        """Forms of its answer."""
        return self.answer or (("{state}",) if self.words else ("{value}",))

    @model_validator(mode="after")
    def _one_bit(self) -> Self:
        if self.bit is not None and self.off_bit is not None:
            raise ValueError("bit means yes and off_bit means no: one of them")
        return self

    @property
    def asks_bit(self) -> bool:
        """Whether a bit of its number is what counts."""
        return self.bit is not None or self.off_bit is not None

    @property
    def _place(self) -> int:
        """Which bit; the lowest where none is named."""
        return self.bit if self.bit is not None else self.off_bit or 0

    def of_bit(self, number: float) -> str:
        """What the bit of a number means: on or off."""
        return "on" if (int(number) >> self._place & 1) != (self.off_bit is not None) else "off"

    def with_bit(self, meaning: str) -> float:
        """A number with the bit that means this, for the twin."""
        return float(((meaning in ("on", "stable")) != (self.off_bit is not None)) << self._place)

    @property
    def said(self) -> str:
        """The question, for messages."""
        if self.ask is None and self.register_ is None:
            return "nothing, since it talks by itself"
        return self.ask if self.ask is not None else f"register {self.register_}"


class Check(Ask):
    """A question whose right answer is known."""

    is_: float | str = Field(alias="is", description="its right answer: a number, or a text")
    why: str = Field("", description="what another answer means, and what to do: `its program runs; end it there`")

    @property
    def forms(self) -> tuple[str, ...]:
        """Forms of its answer."""
        return self.answer or (("{text}",) if isinstance(self.is_, str) and not self.words else super().forms)


class Tell(Register):
    """A command. A text alone is a command without an answer."""

    tell: str | None = Field(
        None,
        description="the line; {value}, {count}, {channel} and parameters are filled in; "
        "can: `MESSAGE: SIGNAL = {value}, SIGNAL = 1`",
    )
    answer: Texts = Field(
        (), description="forms of its acknowledgement; left out: there is none; can: `MESSAGE.SIGNAL = 1`"
    )
    value: float | str | None = Field(
        None, description='number that is written to the register, or a parameter, "{ramp}", in the unit of scale'
    )
    wait_s: float = Field(0.0, ge=0, le=600, description="time that it takes: nothing is sent meanwhile")

    @model_validator(mode="before")
    @classmethod
    def _short(cls, given: Any) -> Any:
        return {"tell": given} if isinstance(given, str) else given

    @property
    def said(self) -> str:
        """The command, for messages."""
        return self.tell if self.tell is not None else f"register {self.register_}"


Tells = Annotated[tuple[Tell, ...], BeforeValidator(_several)]
"""A command, or a sequence of them."""
