"""The documents of a run file, read as far as tables and pages need them: typed, whichever version wrote them.

What plans a run parses them whole (`rig.config`). What only shows or exports one takes a few values from them, and
anybody can have changed each: it is of the kind that is asked for, or an error names document and field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.config import parse_toml
from rig.errors import ConfigurationError
from rig.run_file.bodies import NUMBER, TABLE, TEXT, TRUTH, ContentsError, Kind, shown


class Stored:
    """A table of a stored document, or the whole of one."""

    def __init__(self, values: Mapping[str, Any], where: str) -> None:
        self._values, self._where = values, where

    @classmethod
    def of(cls, documents: Mapping[str, str], name: str) -> Stored:
        """A document by its name; an empty one where it is not there. Raises `ContentsError`."""
        try:
            return cls(parse_toml(documents.get(name, ""), name), name)
        except ConfigurationError as error:
            raise ContentsError(str(error)) from error

    def table(self, name: str) -> Stored:
        """A table in it, empty where it is not there."""
        return Stored(self._value(name, TABLE, {}), f"{self._where}: {name}")

    def tables(self) -> Iterator[tuple[str, Stored]]:
        """Tables in it, by name."""
        return ((name, self.table(name)) for name in self._values)

    def text(self, name: str, default: str = "") -> str:
        """A text."""
        return str(self._value(name, TEXT, default))

    def maybe_text(self, name: str) -> str | None:
        """A text, None where it is not there."""
        return None if name not in self._values else self.text(name)

    def truth(self, name: str) -> bool:
        """True or false, false where it is not there."""
        return bool(self._value(name, TRUTH, False))

    def texts(self) -> dict[str, str]:
        """Everything in it, all texts."""
        return {name: self.text(name) for name in self._values}

    def numbers(self) -> dict[str, float]:
        """Everything in it, all numbers."""
        return {name: float(self._value(name, NUMBER, 0.0)) for name in self._values}

    def everything(self) -> dict[str, Any]:
        """Everything in it, unchecked."""
        return dict(self._values)

    def _value(self, name: str, kind: Kind, default: Any) -> Any:
        value = self._values.get(name, default)
        if not kind.holds(value):
            raise ContentsError(f"{self._where}: {name} cannot be {shown(value)}, it has to be {kind.words}")
        return value

    def __contains__(self, name: str) -> bool:
        return name in self._values


def kind_of_run(documents: Mapping[str, str]) -> str:
    """The kind of calibration that its procedure names; "" where there is none."""
    return Stored.of(documents, "procedure.toml").text("kind")


def declared_model(documents: Mapping[str, str]) -> dict[str, Any]:
    """What stands in `[model]` of the procedure, and always `formula`, None where it has none, and `temperature`.

    What only one kind of calibration has there is as the file has it, and for that kind to check.
    """
    procedure = Stored.of(documents, "procedure.toml")
    model = procedure.table("model")
    formula = model.maybe_text("formula") or procedure.table("expect").maybe_text("model")
    return {**model.everything(), "formula": formula, "temperature": model.truth("temperature")}


def mounting_of(documents: Mapping[str, str]) -> dict[str, float]:
    """How the package is turned by the procedure, degrees by "x_deg" and so on."""
    return Stored.of(documents, "procedure.toml").table("mounting").numbers()
