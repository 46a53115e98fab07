"""What an event is: a frozen dataclass that is stored as a record's kind, status and body, and told in one sentence.

A class names its kind and status and annotates its fields with what they may be (`rig.run_file.bodies`); storing,
opening with checks, and the registry follow from that. A field without a default has to be in a body; others may be
missing in files of earlier versions, and fields of later versions are passed over.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, get_args, get_type_hints

from rig.run_file.bodies import ContentsError, Kind, shown

if TYPE_CHECKING:
    from rig.run_file.chain import Record


class Importance(NamedTuple):
    """Who tells of an event, and how.

    Attributes:
        page: on the page, and whether reports tell it: "fault", "decision", "session", "warning", "step"; "": not.
        level: of its line in the log: "info", "warning", "error"; "": it has none.
        message: what sort of message people get, as in `notify.toml`; "event": none.

    """

    page: str
    level: str
    message: str = "event"


DETAIL = Importance("", "")
"""Belongs to the ordinary course of a point, or is told in another way."""
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

    __hash__ = object.__hash__


EMPTY: Any = _Empty()
"""Default of a table or list that is left out of the body where there is none, as a field that is None is."""


class _Shape(NamedTuple):
    """How a class is stored: its body's fields, which of them must be there, which one is its status."""

    kinds: Mapping[str, Kind]
    names: tuple[str, ...]
    needed: tuple[str, ...]
    status: str | None


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened in a run, as the run file keeps it.

    Attributes:
        kind: of its record.
        matters: how much, where all events of the class matter alike.
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
        """Register the class as that of records of its kind, and of its status where it names one.

        Args:
            kind: see `Event`.
            status: of its records, where all have the same.
            matters: see `Event`.
            exported: see `Event`.
            says: its sentence, with fields in braces; `{at}` is where, `{record.whole_plot}` a column of its record.
            ends: how it ends its session, in words; then that is its sentence too.

        """
        cls.kind, cls._status, cls.matters, cls.exported = kind, status, matters, exported
        cls._says, cls._ends = says or ends, ends
        if kind:
            _CLASSES[kind, status] = cls

    @property
    def status(self) -> str | None:
        """Of its record."""
        name = _shape(type(self)).status
        return self._status if name is None else str(getattr(self, name))

    @property
    def importance(self) -> Importance:
        """Who tells of it, and how."""
        return self.matters

    @property
    def ending(self) -> str:
        """How it ends its session, in words; "" if it does not."""
        return self._ends.format(**vars(self))

    def body(self) -> dict[str, Any]:
        """What the record holds besides its own columns."""
        values = ((name, getattr(self, name)) for name in _shape(type(self)).names)
        return {name: value for name, value in values if value is not None and value is not EMPTY}

    @classmethod
    def of_body(cls, body: Mapping[str, Any], status: str | None) -> Event:
        """The event of a body that was checked."""
        shape = _shape(cls)
        given = {name: body[name] for name in shape.names if name in body}
        if shape.status is not None:
            given[shape.status] = status or ""
        return cls(**given)

    def sentence(self, record: Record) -> str:
        """The event in a person's words.

        Args:
            record: the one that it is of, for session, point and whole plot.

        """
        return self._says.format(at=at(record), record=record, **vars(self))


_CLASSES: dict[tuple[str, str | None], type[Event]] = {}


@dataclass(frozen=True, kw_only=True)
class Unknown(Event, kind=""):
    """An event that this version does not know: another version wrote it.

    Attributes:
        sort: kind and status of its record.
        content: its body.

    """

    sort: str
    content: Mapping[str, Any]

    def sentence(self, record: Record) -> str:
        """Its name, and the sentence that it brings with it, under whichever of these names."""
        found = (self.content[key] for key in ("message", "reason", "why", "cause") if key in self.content)
        said = next((text for text in found if isinstance(text, str) and text), "")
        return f"{self.sort}{at(record)}{f': {said}' if said else ''}"


def at(record: Record) -> str:
    """Where it is of a point: "... at point 3"."""
    return "" if record.run_index is None else f" at point {record.run_index}"


def kinds() -> tuple[str, ...]:
    """Every kind of record."""
    return tuple(dict.fromkeys(kind for kind, _ in _CLASSES))


def class_of(kind: str, status: str | None) -> type[Event]:
    """The class of records of a kind and status."""
    return _CLASSES.get((kind, status)) or _CLASSES.get((kind, None), Unknown)


def decode(kind: str, status: str | None, body: Mapping[str, Any]) -> Event:
    """The event that a record holds; its body was checked."""
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
        ContentsError: it is no JSON object, a field is missing without which it means nothing, or one is of another
            kind than a controller writes.

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
    """What a field is annotated with, also where it may be None; None where it is not."""
    for one in (hint, *get_args(hint)):
        for extra in getattr(one, "__metadata__", ()):
            if isinstance(extra, Kind) or extra is _STATUS:
                return extra
    return None
