"""Options of commands that say how a table is written."""

from __future__ import annotations

import codecs
from dataclasses import dataclass

from rig.errors import UsageError

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "pipe": "|", "space": " "}
DECIMALS = {"point": ".", "comma": ","}


@dataclass(frozen=True)
class FileForm:
    """The user's declarations about a file; what is None or "" is recognised.

    Attributes:
        separator: "," or another character, " " for runs of blanks.
        decimal: "." or ",".
        encoding: a name that Python knows.
        header: row of the column names in the file, from 1; 0 if there are no names.
    """

    separator: str = ""
    decimal: str = ""
    encoding: str = ""
    header: int | None = None

    @classmethod
    def of(cls, separator: str | None, decimal: str | None, encoding: str | None, header: int | None) -> FileForm:
        """Options as written. Raises `UsageError`."""
        given = separator or ""
        found = SEPARATORS.get(given.lower(), "\t" if given == "\\t" else given)
        if found not in ("", *SEPARATORS.values()):
            raise UsageError(f"--separator: {given!r} is none of {', '.join(SEPARATORS)}")
        sign = DECIMALS.get((decimal or "").lower(), decimal or "")
        if sign not in ("", ".", ","):
            raise UsageError(f"--decimal: {decimal!r} is neither point nor comma")
        if found == sign == ",":
            raise UsageError("--separator and --decimal cannot both be a comma")
        if encoding:
            try:
                known = codecs.lookup(encoding)
                b"".decode(known.name)
            except (LookupError, ValueError):
                raise UsageError(f"--encoding: there is no text encoding {encoding!r}; try utf-8 or cp1252") from None
        if header is not None and header < 0:
            raise UsageError("--header: rows are counted from 1; 0 means that there are no names")
        return cls(found, sign, encoding or "", header)

    def words(self) -> list[str]:
        """The options as words of a command."""
        names = {sign: word for word, sign in SEPARATORS.items()}
        found = ["--separator", names[self.separator]] if self.separator else []
        found += ["--decimal", "comma" if self.decimal == "," else "point"] if self.decimal else []
        found += ["--encoding", self.encoding] if self.encoding else []
        return found + (["--header", str(self.header)] if self.header is not None else [])

    def __bool__(self) -> bool:
        return bool(self.separator or self.decimal or self.encoding) or self.header is not None


NOTHING = FileForm()
"""Everything is recognised."""
