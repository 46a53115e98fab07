"""The base of events: a frozen dataclass, stored as a record's kind, status and body, and shown as one sentence.

A class names its kind and status and annotates its fields with their types (`rig.run_file.bodies`). Storage, checks on
reading, and the registry follow from that. A field without a default must be in a body. Other fields may be missing in
files of earlier versions. Fields of later versions are ignored.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, ItemsView, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, get_args, get_type_hints

from rig.run_file.bodies import ContentsError, Kind, shown

if TYPE_CHECKING:
    from rig.run_file.columns import Columns


class Importance(NamedTuple):
    """Importance of an event: where it is shown, and how.

    Attributes:
        page: its class on the live page and in reports: "fault", "decision", "session", "warning", "step"; "":
            none.
        level: level of its line in the log: "info", "warning", "error"; "": no line.
        message: class of its message to people, as in `notify.toml`; "event": no message.

    """

    page: str
    level: str
    message: str = "event"


DETAIL = Importance("", "")
"""Part of the normal work on a point, or shown in another way."""
ROUTINE = Importance("", "info")
STEP = Importance("step", "info")
SESSION = Importance("session", "info")
DECISION = Importance("decision", "info")
LOSS = Importance("fault", "warning", "warning")

_STATUS = object()
Status = Annotated[str, _STATUS]
"""A field that is stored as the record's status, not in its body."""


class _Empty(Mapping[str, Any]):
    def __getitem__(self, name: str) -> Any:
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0

    def items(self) -> ItemsView[str, Any]:
        return _NO_ITEMS  # the view of an abstract mapping takes longer to go through

    __hash__ = object.__hash__


_NO_ITEMS: ItemsView[str, Any] = {}.items()


EMPTY: Any = _Empty()
"""Default of a table or list that is left out of the body if it is missing, like a field that is None."""


class _Shape(NamedTuple):
    """Storage of a class: fields of its body, required fields, and the field that is its status."""

    kinds: Mapping[str, Kind]
    names: tuple[str, ...]
    needed: tuple[str, ...]
    status: str | None


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a run, as stored in the run file.

    Attributes:
        kind: kind of its record.
        matters: importance, if it is the same for all events of the class.
        exported: whether `rig export --all` lists it.

    """

    kind: ClassVar[str] = "event"
    matters: ClassVar[Importance] = STEP
    exported: ClassVar[bool] = False
    _status: ClassVar[str | None] = None
    _says: ClassVar[str] = ""
    _ends: ClassVar[str] = ""

    def __init_subclass__(
        cls,
        *,
        kind: str = "event",
        status: str | None = None,
        matters: Importance = STEP,
        exported: bool = False,
        says: str = "",
        ends: str = "",
    ) -> None:
        """Register the class for records of its kind, and of its status if it names one.

        Args:
            kind: see `Event`.
            status: status of its records, if it is the same for all.
            matters: see `Event`.
            exported: see `Event`.
            says: its sentence, with fields in braces; `{at}` is the place, `{record.whole_plot}` a column of its
                record.
            ends: how it ends its session, in words; this is then its sentence too.

        """
        cls.kind, cls._status, cls.matters, cls.exported = kind, status, matters, exported
        cls._says, cls._ends = says or ends, ends
        if kind:
            _CLASSES[kind, status] = cls

    @property
    def status(self) -> str | None:
        """Status of its record."""
        name = _shape(type(self)).status
        return self._status if name is None else str(getattr(self, name))

    @property
    def importance(self) -> Importance:
        """Its importance."""
        return self.matters

    @property
    def ending(self) -> str:
        """How it ends its session, in words; "" if it does not end it."""
        return self._ends.format(**vars(self))

    def body(self) -> dict[str, Any]:
        """Fields of the record besides its own columns."""
        own = vars(self)
        return {
            name: value for name in _shape(type(self)).names if (value := own[name]) is not None and value is not EMPTY
        }

    @classmethod
    def of_body(cls, body: Mapping[str, Any], status: str | None) -> Event:
        """The event for a checked body."""
        shape = _shape(cls)
        given = {name: body[name] for name in shape.names if name in body}
        if shape.status is not None:
            given[shape.status] = status or ""
        return cls(**given)

    def sentence(self, record: Columns) -> str:
        """The event as a sentence.

        Args:
            record: its record, for session, point and whole plot.

        """
        return self._says.format(at=at(record), record=record, **vars(self))


_CLASSES: dict[tuple[str, str | None], type[Event]] = {}


@dataclass(frozen=True, kw_only=True)
class Unknown(Event, kind=""):
    """An event of an unknown kind, written by another version.

    Attributes:
        sort: kind and status of its record.
        content: its body.

    """

    sort: str
    content: Mapping[str, Any]

    def sentence(self, record: Columns) -> str:
        """Its name, and the sentence stored in its body, under any of these keys."""
        found = (self.content[key] for key in ("message", "reason", "why", "cause") if key in self.content)
        said = next((text for text in found if isinstance(text, str) and text), "")
        return f"{self.sort}{at(record)}{f': {said}' if said else ''}"


def at(record: Columns) -> str:
    """The place, if it has a point: "... at point 3"."""
    return "" if record.run_index is None else f" at point {record.run_index}"


def kinds() -> tuple[str, ...]:
    """Every kind of record."""
    return tuple(dict.fromkeys(kind for kind, _ in _CLASSES))


def class_of(kind: str, status: str | None) -> type[Event]:
    """The class of records of a kind and status."""
    return _CLASSES.get((kind, status)) or _CLASSES.get((kind, None), Unknown)


def decode(kind: str, status: str | None, body: Mapping[str, Any]) -> Event:
    """The event of a record, with a checked body."""
    cls = class_of(kind, status)
    if cls is Unknown:
        return Unknown(sort=" ".join(str(part) for part in (kind, status) if part).replace("-", " "), content=body)
    return cls.of_body(body, status)


def body_of(text: object, kind: str, status: str | None, where: Callable[[], str]) -> dict[str, Any]:
    """A body decoded and checked.

    Args:
        text: as stored.
        kind: of the record.
        status: of the record.
        where: names the record, for errors.

    Raises:
        ContentsError: it is not a JSON object, a required field is missing, or a field has a wrong type.

    """
    if not isinstance(text, str):
        raise ContentsError(f"{where()}: its body is no text")
    try:
        decoded = json.loads(text)
    except RecursionError:
        raise ContentsError(f"{where()}: its body is JSON nested too deeply") from None
    except ValueError as error:
        raise ContentsError(f"{where()}: its body is not JSON: {error}") from error
    if not isinstance(decoded, dict):
        raise ContentsError(f"{where()}: its body is JSON, but not an object")
    shape = _shape(class_of(kind, status))
    for name in shape.needed:
        if name not in decoded:
            raise ContentsError(f"{where()}: its body has no {name}")
    for name, field_kind in shape.kinds.items():
        if name in decoded and not field_kind.holds(decoded[name]):
            what = f"its {name} cannot be {shown(decoded[name])}, it has to be {field_kind.words}"
            raise ContentsError(f"{where()}: {what}")
    return decoded


def _shape(cls: type[Event]) -> _Shape:
    found = _SHAPES.get(cls)
    if found is None:
        found = _SHAPES[cls] = _shape_of(cls)
    return found


_SHAPES: dict[type[Event], _Shape] = {}


def _shape_of(cls: type[Event]) -> _Shape:
    if cls is Unknown:
        return _Shape({}, (), (), None)
    hints = get_type_hints(cls, include_extras=True)
    marks = {f.name: _mark(hints[f.name]) for f in dataclasses.fields(cls)}
    stored = [f for f in dataclasses.fields(cls) if marks[f.name] is not _STATUS]
    return _Shape(
        {f.name: mark for f in stored if isinstance(mark := marks[f.name], Kind)},
        tuple(f.name for f in stored),
        tuple(f.name for f in stored if f.default is dataclasses.MISSING),
        next((name for name, mark in marks.items() if mark is _STATUS), None),
    )


def _mark(hint: Any) -> Any:
    """The type of a field by its annotation, also if it may be None; None if it has no such annotation."""
    for one in (hint, *get_args(hint)):
        for extra in getattr(one, "__metadata__", ()):
            if isinstance(extra, Kind) or extra is _STATUS:
                return extra
    return None
