"""Attributes of drivers of other libraries: found by their path, read as text, set.

A path is what one would write in Python after the instrument and a point: `voltage`, `ch_1.output`, `channels[0].volt`,
`measure()`, `ask(":READ?")`. Only names, numbers and texts are understood; nothing is evaluated.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, Protocol

_MOST = 10_000  # numbers of one answer; chosen


class Wrong(Exception):
    """A request that cannot be carried out; a sentence.

    Attributes:
        kind: "missing library", "open", or "request".
    """

    def __init__(self, said: str, kind: str = "request") -> None:
        super().__init__(said)
        self.kind = kind


class Library(Protocol):
    """A driver of a library, in the process of a bridge."""

    def identity(self) -> tuple[str, str, str, str]:
        """Maker, model, serial number and firmware, "" for what it does not say."""
        ...

    def read(self, path: str) -> tuple[Any, str, float | None]:
        """A value, its unit and its time, as far as the library says them."""
        ...

    def write(self, path: str, text: str) -> None:
        """Set an attribute."""
        ...

    def call(self, path: str) -> None:
        """Carry out a call."""
        ...

    def close(self) -> None:
        """Release the instrument."""
        ...


def class_named(what: str, within: str, base: type) -> type:
    """The class `MODULE.CLASS`, in a package or by itself. Raises `Wrong` if it is no driver of the library."""
    import importlib  # noqa: PLC0415

    module, _, name = what.rpartition(".")
    tried = []
    for place in (f"{within}.{module}", module):
        try:
            found = getattr(importlib.import_module(place), name, None)
        except ModuleNotFoundError as error:
            if not f"{place}.".startswith(f"{error.name}."):
                raise  # of something that the module itself needs
            tried.append(place)
            continue
        if isinstance(found, type) and issubclass(found, base):
            return found
        tried.append(f"{place}.{name}")
    raise Wrong(f"there is no driver {' or '.join(tried)}")


def identity_in(text: str) -> tuple[str, str, str, str]:
    """Maker, model, serial number and firmware in an answer to `*IDN?`; another answer is the model."""
    parts = [part.strip() for part in text.strip().split(",")]
    if len(parts) < 3:
        return "", text.strip(), "", ""
    maker, model, serial, *rest = parts
    return maker, model, serial, " ".join(rest)


def found_at(root: Any, path: str) -> Any:
    """The object at a path. Raises `Wrong`."""
    try:
        node = ast.parse(path.strip(), mode="eval").body
    except SyntaxError:
        raise Wrong(f"{path!r} is no attribute, such as voltage, ch_1.voltage, channels[0].volt or measure()") from None
    return _at(root, node, path)


def _at(root: Any, node: ast.expr, path: str) -> Any:
    match node:
        case ast.Name(id=name):
            return _attribute(root, name)
        case ast.Attribute(value=before, attr=name):
            return _attribute(_at(root, before, path), name)
        case ast.Subscript(value=before, slice=index):
            return _at(root, before, path)[_constant(index, path)]
        case ast.Call(func=function, args=args, keywords=keywords):
            given = {str(one.arg): _constant(one.value, path) for one in keywords}
            return _at(root, function, path)(*(_constant(one, path) for one in args), **given)
    raise Wrong(f"{path!r} is more than attributes, numbers and texts")


def called(root: Any, path: str) -> None:
    """Carry out a call. Raises `Wrong` if a path is none."""
    if not path.strip().endswith(")"):
        raise Wrong(f"{path} is no call; write {path}(), or {path} = VALUE")
    found_at(root, path)


def _constant(node: ast.expr, path: str) -> Any:
    try:
        return ast.literal_eval(node)
    except ValueError:
        raise Wrong(f"{path!r} is more than attributes, numbers and texts") from None


def _attribute(of: Any, name: str) -> Any:
    if name.startswith("_"):
        raise Wrong(f"{name} is private in {type(of).__name__}")
    try:
        return getattr(of, name)
    except AttributeError:
        if name in dir(of):
            raise
        raise no_attribute(of, name) from None


def no_attribute(of: Any, name: str, does: str = "has no attribute") -> Wrong:
    """The error for a name that an object does not have."""
    near = difflib.get_close_matches(name, [one for one in dir(of) if not one.startswith("_")], n=3)
    return Wrong(f"{type(of).__name__} {does} {name}{'; did you mean ' + ' or '.join(near) + '?' if near else ''}")


def parent_of(root: Any, path: str) -> tuple[Any, str]:
    """The object whose attribute a path is, and the attribute's name. Raises `Wrong`."""
    before, _, name = path.strip().rpartition(".")
    if not name.isidentifier() or name.startswith("_"):
        raise Wrong(f"{path!r} cannot be set: it is no attribute, such as voltage or ch_1.voltage")
    return (found_at(root, before) if before else root), name


def literal(text: str) -> Any:
    """A number, a truth value, or a text."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def printed(value: Any, path: str) -> tuple[str, str]:
    """A value as text, and its unit if it has one. Raises `Wrong` if it is neither number nor text."""
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # of pint
        text, _ = printed(value.magnitude, path)
        return text, f"{value.units:~C}"
    if hasattr(value, "tolist"):  # of numpy
        value = value.tolist()
    match value:
        case bool():
            return str(int(value)), ""
        case Enum() if not isinstance(value, int):
            return printed(value.value if isinstance(value.value, int | float | str) else value.name, path)
        case int():
            return str(int(value)), ""
        case float():
            return repr(float(value)), ""
        case str():
            return " ".join(value.split()), ""
        case list() | tuple() if len(value) <= _MOST and not any(isinstance(one, list | tuple) for one in value):
            return ",".join(printed(one, path)[0] for one in value), ""
        case None:
            return "None", ""
        case Mapping():
            keys = ", ".join(map(repr, list(value)[:8]))
            raise Wrong(f"{path} has several values; name one of them: {path}[KEY] with one of {keys}")
    if isinstance(value, Callable):  # type: ignore[arg-type]
        raise Wrong(f"{path} is a method; write {path}()")
    raise Wrong(f"{path} is a {type(value).__name__}, which is neither a number nor a text")
