"""Options of SCPI instruments that a bench file describes: identity, prepare lines, questions, number format.

What is written here is sent as it is. So every text is checked: printable ASCII on one line, a question where a
question belongs, and the placeholder that it needs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from rig.drivers.wires import SerialOptions
from rig.drivers.wires.serial_port import Frame

_LINE = re.compile(r"[ -~]{1,200}")
_NUMBER_AND_UNIT = r"([+-]?[0-9.]+(?:[Ee][+-]?[0-9]+)?(?: *[A-Za-z%][A-Za-z0-9%/ ]*)?)(?:[^A-Za-z0-9%/].*)?"
_HOLES = re.compile(r"\{[^}]*\}|[{}]")


def _printable(text: str) -> str:
    if not _LINE.fullmatch(text) or text != text.strip():
        raise ValueError("must be one line of 1 to 200 printable ASCII characters, without spaces around it")
    return text


def _question(text: str) -> str:
    if "?" not in _printable(text):
        raise ValueError(f"{text!r} is not a question: it has no question mark")
    return text


def _command(text: str) -> str:
    if "?" in _printable(text):
        raise ValueError(f"{text!r} is a question; this is for commands, which have no answer")
    return text


def filled(name: str) -> Callable[[str], str]:
    """A validator: a command with the placeholder {name}, and no other."""

    def check(text: str) -> str:
        holes = _HOLES.findall(_command(text))
        if holes != [f"{{{name}}}"]:
            raise ValueError(f"{text!r} needs the placeholder {{{name}}} once, and no other brace")
        return text

    return check


def _pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"{text!r} is not a regular expression: {error}") from None
    return text


def _number_form(text: str) -> str:
    if _HOLES.findall(_printable(text)) != ["{number}"]:
        raise ValueError(f"{text!r} needs the placeholder {{number}} once, and no other brace")
    return text


Command = Annotated[str, AfterValidator(_command)]
"""A line without an answer."""

Question = Annotated[str, AfterValidator(_question)]
"""A line with an answer of one line."""

NumberForm = Annotated[str, AfterValidator(_number_form)]
"""An answer with {number} in place of its number; * is any text."""

Unit = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9]*(_per_[A-Za-z][A-Za-z0-9]*)?$")]
"""A unit as at the end of column names: `V`, `m3_per_h`."""

Answer = Annotated[str, Field(min_length=1)] | float
"""The answer that a setting has: a number, or a text to be equal to."""


class ScpiOptions(SerialOptions):
    """Options of every instrument that the bench file describes."""

    model: str = Field("", description="second field of its answer to *IDN?")
    maker: str = Field("", description="first field of its answer to *IDN?; not compared if empty")
    identity: Annotated[str, AfterValidator(_pattern)] = Field(
        "", description="regular expression for its whole answer to *IDN?, instead of model"
    )
    unit: Unit = Field("V", description="unit of its quantity, as at the end of column names")
    prepare: tuple[Command, ...] = Field((), description="lines that prepare it; after each its errors are read")
    check: dict[Question, Answer] = Field(
        {}, description="question to the answer after preparing, and before and after the readings of every point"
    )
    healthy: dict[Question, Answer] = Field({}, description="question to its answer without a fault")
    error: Question = Field(
        "SYST:ERR?", description="reads and removes its oldest error; *ESR? if it has no error queue"
    )
    number: NumberForm = Field("{number}", description="form of an answer with a {number}; * is any text")
    digits: Annotated[str, AfterValidator(_pattern)] = Field(
        "",
        description="regular expression for a whole {number}; another one lost or doubled a character on its way, and "
        "is refused; left out: any number is believed",
    )
    mark: bool = Field(
        True, description="keep a mark in *ESE that power-off clears; false: settings of check tell that it was off"
    )
    timeout_s: float = Field(2.0, ge=0.05, le=60.0, description="maximum wait for an answer")
    pace_s: float = Field(0.0, ge=0.0, le=5.0, description="minimum time between lines sent to it")
    baud: int = Field(9600, ge=300, le=921600, description="symbols per second")
    frame: Frame = Field("8N1", description="data bits, parity, stop bits")

    @model_validator(mode="after")
    def _known(self) -> Self:
        if bool(self.model) == bool(self.identity):
            raise ValueError("give model, or identity (a regular expression), so that no other instrument is used")
        if self.maker and self.identity:
            raise ValueError("maker is compared with model; identity describes the whole answer")
        if not self.mark and not self.check:
            raise ValueError("without mark, check is needed: nothing else tells that its power has been off")
        return self

    @property
    def number_pattern(self) -> re.Pattern[str]:
        """The form of an answer as a regular expression with one group: the number, and a unit after it."""
        before, after = self.number.split("{number}")
        if after.lstrip(" ").startswith("*"):
            return re.compile(f"{_any_text(before)}{_NUMBER_AND_UNIT}{_any_text(after.lstrip(' ')[1:])}")
        return re.compile(f"{_any_text(before)}(.*?){_any_text(after)}")

    @property
    def wanted(self) -> Mapping[str, float | str]:
        """Answers to check."""
        return {
            question: answer if isinstance(answer, str) else float(answer) for question, answer in self.check.items()
        }


def _any_text(part: str) -> str:
    return ".*".join(map(re.escape, part.split("*")))
