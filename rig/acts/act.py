"""The base of acts: what a person or a program may do in a laboratory, each one class.

A class names its act, the role that may do it, and whether something moves, and has its values as fields. Pages, JSON
API, its OpenAPI file and `rig act` follow from that; a further act is a further class, and no other place changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator

from rig.acts.places import Places
from rig.errors import UsageError
from rig.files.explained import explain
from rig.lab.people import Role
from rig.who import Operator


@dataclass(frozen=True)
class Told:
    """What came of an act.

    Attributes:
        words: a sentence.
        about: values, as JSON.
        page: address of the page that shows it, "" for none.
    """

    words: str
    about: Mapping[str, Any] = field(default_factory=dict)
    page: str = ""


class Act(BaseModel):
    """An act with its values.

    Attributes:
        name: its name, a word.
        role: the role that may do it; "" for everybody, who changes the own entry.
        moves: whether something may move after it: it is then confirmed once more.
        again: whether the password is asked for again.
        slow: whether it takes seconds of a processor: a server does it in a process of its own.
        brief: of a slow one, whether it takes seconds only: it then waits for none that takes minutes.
        proposes: whether it commands nothing and decides nothing, so that a language model may do it (`rig mcp`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, str_strip_whitespace=True)

    name: ClassVar[str] = ""
    role: ClassVar[Role | Literal[""]] = "operator"
    moves: ClassVar[bool] = False
    again: ClassVar[bool] = False
    slow: ClassVar[bool] = False
    brief: ClassVar[bool] = False
    proposes: ClassVar[bool] = False

    def __init_subclass__(
        cls,
        *,
        act: str,
        role: Role | Literal[""] = "operator",
        moves: bool = False,
        again: bool = False,
        slow: bool = False,
        brief: bool = False,
        proposes: bool = False,
    ) -> None:
        """Register the class; arguments are the attributes of the same names."""
        super().__init_subclass__()
        if proposes and (moves or again):
            raise TypeError(f"{act} moves or decides something: it is more than a proposal")
        cls.name, cls.role, cls.moves, cls.again, cls.slow, cls.proposes = act, role, moves, again, slow, proposes
        cls.brief = brief
        _ACTS[act] = cls

    @field_validator("*")
    @classmethod
    def _one_line(cls, value: object, info: ValidationInfo) -> object:
        lines = LINES in of_field(cls, info.field_name or "")
        if isinstance(value, str) and not value.isprintable() and not lines:
            raise ValueError("a text has one line of printable characters")
        return value

    @classmethod
    def proposed_values(cls, given: Mapping[str, str], places: Places) -> Mapping[str, str]:
        """Values that a form proposes, by those that are given."""
        return {}

    def will(self, places: Places) -> str:
        """What will happen, a sentence, for the person who confirms it. Raises `UsageError` if it cannot happen."""
        return self.does()

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Do it, for a person. Raises `RigError`."""
        raise NotImplementedError

    @classmethod
    def does(cls) -> str:
        """What it does, the first sentence of its description."""
        return (cls.__doc__ or "").split("\n\n")[0].strip()


_ACTS: dict[str, type[Act]] = {}
LINES, KEPT, SECRET = "lines", "kept", "secret"
"""Marks of a field: a text of several lines; a value that a form carries along, and nobody types; one never shown."""


def of_field(act: type[Act], name: str) -> Mapping[str, Any]:
    """Marks of a field, such as the sort of names that it may have, `of`."""
    extra = act.model_fields[name].json_schema_extra if name in act.model_fields else None
    return extra if isinstance(extra, dict) else {}


def acts() -> Iterator[type[Act]]:
    """All acts, in the order of their modules."""
    yield from _ACTS.values()


def act_of(name: str, values: Mapping[str, Any]) -> Act:
    """An act with its values, as texts or as JSON. Raises `UsageError`."""
    if name not in _ACTS:
        raise UsageError(f"there is no act {name!r:.40} (known: {', '.join(_ACTS)})")
    given = {key: value for key, value in values.items() if value != ""}
    try:
        return _ACTS[name].model_validate(given)
    except ValidationError as error:
        raise UsageError(explain(error, name, _ACTS[name])) from None
