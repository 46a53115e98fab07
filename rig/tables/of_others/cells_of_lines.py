"""Lines of a text as cells, for one separator."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

_BREAK = re.compile(r"\r\n|\n|\r")
_REMARK = re.compile(r" *(?:[#%!*]|//)")
_RULE = re.compile(r"[\s=+_.|~-]*")
_JOINED = 20


@dataclass(frozen=True)
class Line:
    """One line of a file, or several that a quoted cell joins.

    Attributes:
        row: number of its first line in the file, from 1.
        text: without its end.
        remark: whether it begins with a sign of remarks, or is a ruled line.
        apart: whether a blank line or an empty row stands before it.
    """

    row: int
    text: str
    remark: bool
    apart: bool = False

    def cells(self, separator: str) -> list[str]:
        """Its cells, without quotes and blanks around them."""
        return split(self.text, separator)

    @property
    def remarked(self) -> str:
        """The text of a remark without its sign."""
        return re.sub(r"^\s*(?:[#%!*;]+|//)\s*", "", self.text)


def lines_of(text: str) -> Iterator[Line]:
    """The lines of a text that are not blank. An empty row of a spreadsheet is a line of separators alone."""
    pending, first, joined, apart = "", 0, 0, False
    for row, piece in enumerate(_BREAK.split(text), start=1):
        if pending:
            whole, joined = f"{pending} {piece}", joined + 1
            if piece.count('"') % 2 == 0 and joined < _JOINED:
                pending = whole
                continue
            pending, piece, row = "", whole, first  # noqa: PLW2901 - they are one line
        elif piece.count('"') % 2 and re.search(r'(?:^|[,;\t|])\s*"[^"]*$', piece):
            pending, first, joined = piece, row, 0
            continue
        if piece.strip(' \t,;|"'):
            yield _line(row, piece, apart=apart)
            apart = False
        else:
            apart = True
    if pending:
        yield _line(first, pending, apart=apart)


def _line(row: int, text: str, *, apart: bool) -> Line:
    rule = len(text.strip()) > 2 and _RULE.fullmatch(text) is not None and not any(c in text for c in ";,\t|")
    return Line(row, text, rule or _REMARK.match(text) is not None, apart)


def quoted_whole(lines: Sequence[Line]) -> list[Line]:
    """Lines without quotes around the whole of each, as spreadsheets write a pasted text; [] if there are none."""
    if not lines or not all(re.fullmatch(r'"[^"]*[,;\t|][^"]*"', line.text) for line in lines):
        return []
    return [Line(line.row, line.text[1:-1], line.remark, line.apart) for line in lines]


def split(text: str, separator: str) -> list[str]:
    """Cells of a line, without quotes and blanks around them."""
    if separator == " ":
        if '"' not in text:
            return text.split()
        return [one.strip('"').strip() for one in re.findall(r'"[^"]*"|[^\s"]+', text)]
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    cells, cell, quoted, i = [], "", False, 0
    while i < len(text):
        sign = text[i]
        if quoted:
            if sign == '"' and text[i + 1 : i + 2] == '"':
                cell, i = cell + '"', i + 1
            elif sign == '"':
                quoted = False
            else:
                cell += sign
        elif sign == '"' and not cell.strip():
            quoted, cell = True, ""
        elif sign == separator:
            cells.append(cell.strip())
            cell = ""
        else:
            cell += sign
        i += 1
    return [*cells, cell.strip()]
