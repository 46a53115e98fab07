"""The documents of a run file: typed access to the values that tables and pages need, for files of any version.

Planning a run parses whole documents (`rig.bench.config`). Showing or exporting a run takes only a few values. Anybody
may have changed these, so each is checked: it has the requested type, or an error names document and field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.bench.config import parse_toml
from rig.errors import ConfigurationError
from rig.run_file.bodies import NUMBER, TABLE, TEXT, TRUTH, ContentsError, Kind, shown


class Stored:
    """A stored document, or a table in it."""

    def __init__(self, values: Mapping[str, Any], where: str) -> None:
        self._values, self._where = values, where

    @classmethod
    def of(cls, documents: Mapping[str, str], name: str) -> Stored:
        """A document by name; an empty one if it is missing. Raises `ContentsError`."""
        try:
            return cls(parse_toml(documents.get(name, ""), name), name)
        except ConfigurationError as error:
            raise ContentsError(str(error)) from error

    def table(self, name: str) -> Stored:
        """A table in it; empty if it is missing."""
        return Stored(self._value(name, TABLE, {}), f"{self._where}: {name}")

    def tables(self) -> Iterator[tuple[str, Stored]]:
        """Tables in it, by name."""
        return ((name, self.table(name)) for name in self._values)

    def text(self, name: str, default: str = "") -> str:
        """A text."""
        return str(self._value(name, TEXT, default))

    def maybe_text(self, name: str) -> str | None:
        """A text; None if it is missing."""
        return None if name not in self._values else self.text(name)

    def truth(self, name: str) -> bool:
        """True or false; false if it is missing."""
        return bool(self._value(name, TRUTH, False))

    def texts(self) -> dict[str, str]:
        """All its values; every value must be a text."""
        return {name: self.text(name) for name in self._values}

    def numbers(self) -> dict[str, float]:
        """All its values; every value must be a number."""
        return {name: float(self._value(name, NUMBER, 0.0)) for name in self._values}

    def everything(self) -> dict[str, Any]:
        """All its values, unchecked."""
        return dict(self._values)

    def _value(self, name: str, kind: Kind, default: Any) -> Any:
        value = self._values.get(name, default)
        if not kind.holds(value):
            raise ContentsError(f"{self._where}: {name} cannot be {shown(value)}, it has to be {kind.words}")
        return value

    def __contains__(self, name: str) -> bool:
        return name in self._values


def kind_of_run(documents: Mapping[str, str]) -> str:
    """The kind of calibration in the procedure; "" if there is none."""
    return Stored.of(documents, "procedure.toml").text("kind")


def declared_model(documents: Mapping[str, str]) -> dict[str, Any]:
    """Table `[model]` of the procedure, always with `formula` (None if missing) and `temperature`.

    Keys that belong to one kind of calibration are passed on unchecked; that kind checks them.
    """
    procedure = Stored.of(documents, "procedure.toml")
    model = procedure.table("model")
    formula = model.maybe_text("formula") or procedure.table("expect").maybe_text("model")
    return {**model.everything(), "formula": formula, "temperature": model.truth("temperature")}


def mounting_of(documents: Mapping[str, str]) -> dict[str, float]:
    """Orientation of the package by the procedure, degrees: "x_deg" and so on."""
    return Stored.of(documents, "procedure.toml").table("mounting").numbers()
