"""Where the table is in a file: its separator, its names and units, and the first and last of its rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from procedures.clock import stamp_of
from rig.errors import UsageError
from rig.tables.of_others.asked import SEPARATORS, Asked
from rig.tables.of_others.lines import Line, split
from rig.tables.of_others.numbers import is_missing, looks_like_number
from rig.tables.of_others.units import bare, is_unit

MOST_COLUMNS = 2000
NO_SEPARATOR = "\n"
"""What separates the cells of a table of one column: nothing in a line does."""
_SAMPLE = 400
_ALIKE = 0.02
_FEW, _MANY, _TAIL = 2, 4, 20
_EXTRA = re.compile(r"comments?|notes?|remarks?", re.IGNORECASE)


class NoTable(UsageError):
    """The file holds no table that is recognised."""


@dataclass(frozen=True)
class Layout:
    """The table of a file.

    Attributes:
        separator: between cells.
        names: of the columns; "" for a column without a name.
        header: row of the names in the file; 0 if there is none.
        units: of the columns, from a row under the names; () without one.
        body: lines of values.
        before: number of lines before the names that are not remarks.
        after: rows of lines after the table, which do not belong to it.
        earlier: last row of another table before this one; 0 if there is none.
    """

    separator: str
    names: tuple[str, ...]
    header: int
    units: tuple[str, ...]
    body: Sequence[Line]
    before: int
    after: tuple[int, ...]
    earlier: int = 0


def is_value(cell: str) -> bool:
    """Whether a cell is a number, a time or a missing value, in some notation."""
    return is_missing(cell) or looks_like_number(cell) or is_time(cell)


def is_time(cell: str) -> bool:
    """Whether a cell looks like a date or a time of day."""
    return stamp_of(cell) is not None


def layout_of(lines: Sequence[Line], name: str, asked: Asked) -> Layout:
    """The layout of a file.

    Args:
        lines: of the file, none blank.
        name: of the file, for messages.
        asked: declarations of the user.

    Raises:
        UsageError: there is no table, or it can be read in several ways.
    """
    tried = [asked.separator] if asked.separator else list(SEPARATORS.values())
    if (alone := _one_column(lines, name, asked)) is not None:
        return alone
    found = [(_merit(block), block) for separator in tried if (block := _block(lines, separator, asked))]
    if not found:
        raise NoTable(
            f"{name} holds no table that is recognised: no rows of two columns or more that end the file; say "
            "--separator, --header or --encoding"
        )
    found.sort(key=lambda each: -each[0])
    best = found[0][1]
    near = [block for merit, block in found if found[0][0] - merit < _ALIKE]
    best = next((block for block in near if block.separator != " "), best)  # blanks also stand beside separators
    rivals = [block for block in near if block.separator not in (best.separator, " ") and not _same(best, block)]
    if rivals:
        words = {sign: word for word, sign in SEPARATORS.items()}
        raise UsageError(
            f"{name}, row {best.lines[0].row}: its cells may be separated by {words[best.separator]} or by "
            f"{words[rivals[0].separator]}; say --separator"
        )
    _check_only(lines, best, name, asked)
    return replace(_with_names(lines, best, name, asked), earlier=_earlier(lines[: best.start], best.separator))


def _one_column(lines: Sequence[Line], name: str, asked: Asked) -> Layout | None:
    """The layout of a file with one number in each line, and a name above them or none; None for any other.

    Raises:
        UsageError: the numbers have signs that may also separate cells.
    """
    plain = [line for line in lines if not line.remark]
    if asked.separator or len(plain) < 2 or asked.header not in (None, 0, plain[0].row):
        return None
    head, body = plain[0].cells(NO_SEPARATOR)[0], plain[1:]
    if asked.header == 0 or looks_like_number(head):
        head, body = "", plain
    cells, end = [line.cells(NO_SEPARATOR)[0] for line in body], len(body)
    after: tuple[int, ...] = ()
    while end and not (is_missing(cells[end - 1]) or looks_like_number(cells[end - 1])):
        end -= 1
    if any(line.apart for line in body[end : end + 1]) or all(cell[0].isalpha() for cell in cells[end:]):
        after, body, cells = tuple(line.row for line in body[end:]), body[:end], cells[:end]
    if not body:
        return None
    named = head and not is_value(head) and not any(sign in head for sign in ",;\t|") and not body[0].apart
    if (head and not named) or not all(is_missing(cell) or looks_like_number(cell) for cell in cells):
        return None
    for line in body:
        parts = [word for word, sign in SEPARATORS.items() if len(line.cells(sign)) > 1]
        if parts and not head:
            return None
        if parts and not asked.decimal:
            count = len(line.cells(SEPARATORS[parts[0]]))
            raise UsageError(
                f"{name}, row {line.row}: {line.text.strip()} may be one value, or {count} columns; say "
                f"--decimal point or --decimal comma for one, or --separator {parts[0]} for several"
            )
    return Layout(NO_SEPARATOR, (head,), plain[0].row if head else 0, (), body, 0, after)


def _earlier(above: Sequence[Line], separator: str) -> int:
    """The last row of a table among lines; 0 if there are only a few rows with several numbers."""
    numbers = [
        line.row
        for line in above
        if not line.remark and sum(1 for cell in line.cells(separator) if looks_like_number(cell)) > 1
    ]
    return numbers[-1] if len(numbers) > _MANY and separator != " " else 0


def _check_only(lines: Sequence[Line], block: _Block, name: str, asked: Asked) -> None:
    """Refuse other rows of values before the block."""
    above = [line for line in lines[: block.start] if not line.remark]
    values = [line for line in above if _data(line.cells(block.separator))]
    if asked.header != 0 and above and not _heads(block):
        cells = _trimmed(above[-1].cells(block.separator))
        if len(cells) > 1 and any(looks_like_number(cell) for cell in cells):
            raise UsageError(
                f"{name}, row {above[-1].row}: {len(cells)} values, and {block.count} in the rows after it; correct "
                "the row, or say --header 0 if it does not belong to the table"
            )
    alike = [line for line in values if len(_trimmed(line.cells(block.separator))) == block.count]
    if len(alike) > _FEW:
        raise UsageError(
            f"{name} holds several tables: one ends in row {alike[-1].row}, another begins in row "
            f"{block.lines[0].row}; make a file of each, or say --header for the last one"
        )


@dataclass(frozen=True)
class _Block:
    """Neighbouring lines with the same number of cells.

    Attributes:
        separator: between cells.
        count: number of cells.
        start: index of the first line.
        lines: without remarks.
        after: rows of lines after it.
        sample: cells of some of the lines.
    """

    separator: str
    count: int
    start: int
    lines: Sequence[Line]
    after: tuple[int, ...]
    sample: Sequence[list[str]]


def _block(lines: Sequence[Line], separator: str, asked: Asked) -> _Block | None:
    """The last and longest block of lines with two cells or more; None if there is none."""
    plain = [(i, line) for i, line in enumerate(lines) if not line.remark]
    if asked.header is not None:
        plain = [(i, line) for i, line in plain if line.row >= asked.header]
    if not plain:
        return None
    cells = [line.cells(separator) for _, line in plain]
    every = [len(_trimmed(row)) for row in cells]
    end = len(plain)
    while end and len(cells[end - 1]) <= 1:
        end -= 1
    raw = [len(row) for row in cells]
    run = end
    while run and _data(cells[run - 1]) and raw[run - 1] == raw[end - 1]:
        run -= 1
    tail = range(max(run if end - run > 1 else 0, end - _TAIL), end)
    usual = max((raw[i] for i in tail), key=[raw[i] for i in tail].count, default=0)
    most = max((every[i] for i in tail if raw[i] == usual), default=0)
    while end and raw[end - 1] != usual and every[end - 1] < most and not is_value(cells[end - 1][0]):
        end -= 1  # words in a line of its own form, under the table
    begin = end
    while begin and (
        raw[begin - 1] == usual or every[begin - 1] == most or (every[begin - 1] < most and _data(cells[begin - 1]))
    ):
        begin -= 1
    count = max((every[i] for i in range(begin, end) if raw[i] == usual or every[i] == most), default=0)
    if count < 2 or count > MOST_COLUMNS or begin == end:
        return None
    taken = [line for _, line in plain[begin:end]]
    sample = [line.cells(separator) for line in (taken[: _SAMPLE // 2] + taken[_SAMPLE // 2 :][-_SAMPLE // 2 :])]
    after = tuple(line.row for _, line in plain[end:])
    return _Block(separator, count, plain[begin][0], taken, after, sample)


def _data(cells: Sequence[str]) -> bool:
    """Whether a line has several cells, and nothing but values."""
    return len(cells) > 1 and all(is_value(cell) for cell in cells)


def _trimmed(cells: list[str]) -> list[str]:
    """Cells without blank ones at the end."""
    end = len(cells)
    while end and not cells[end - 1]:
        end -= 1
    return cells[:end]


def _merit(block: _Block) -> float:
    """The share of cells that are values, from 0 to 1."""
    cells = [cell for row in block.sample[1:] or block.sample for cell in row]
    return sum(1 for cell in cells if is_value(cell)) / max(len(cells), 1) * min(1.0, (len(block.lines) + 1) / 4)


def _same(one: _Block, other: _Block) -> bool:
    """Whether two separators give the same cells."""
    rows = ([[cell for cell in row if cell] for row in block.sample[-_TAIL:]] for block in (one, other))
    return next(rows) == next(rows)


def _with_names(lines: Sequence[Line], block: _Block, name: str, asked: Asked) -> Layout:
    """A block with its names and units."""
    heads = _heads(block) if asked.header != 0 else 0
    if asked.header:
        heads = max(heads, 1)
    rows = [_full(line.cells(block.separator), block.count) for line in block.lines[:heads]]
    while len(rows) > 1 and rows[-1] == rows[-2]:  # the names twice, as of a logger that was started again
        del rows[-1]
    first = block.lines[0].row if heads else 0
    units: tuple[str, ...] = ()
    before = sum(1 for line in lines[: block.start] if not line.remark)
    if heads >= 2 and all(is_unit(cell) or is_missing(cell) for cell in rows[-1]):
        units = tuple(bare(cell) for cell in rows.pop())
    if len(rows) > 1 and asked.header:
        raise UsageError(
            f"{name}, row {block.lines[1].row}: {rows[1][0]!r} is not a value; are there two rows of names?"
        )
    if len(rows) > 1:
        full = [all(row) and len(set(row)) == len(row) and not any(map(is_value, row)) for row in rows[-2:]]
        if full != [False, True]:
            first, last = block.lines[len(rows) - 2].row, block.lines[len(rows) - 1].row
            raise UsageError(
                f"{name}: rows {first} and {last} may both hold the names of the columns; say --header with the row"
            )
        before, first, rows = before + len(rows) - 1, block.lines[len(rows) - 1].row, rows[-1:]
    if rows:
        return Layout(block.separator, tuple(rows[0]), first, units, block.lines[heads:], before, block.after)
    names, first, units, used = ((), 0, (), 0) if asked.header == 0 else _names_above(lines, block)
    if not names and asked.header != 0:
        _check_above(lines, block, name)
    named = names or tuple("" for _ in range(block.count))
    return Layout(block.separator, named, first, units, block.lines, before - used, block.after)


def _full(cells: list[str], count: int) -> list[str]:
    return [*cells[:count], *[""] * (count - len(cells))]


def _heads(block: _Block) -> int:
    """Number of leading lines with text where the other lines have values."""
    rest = block.sample[min(3, len(block.sample) - 1) :]
    values = [
        sum(1 for row in rest if i < len(row) and is_value(row[i]) and not is_missing(row[i])) > 0.5 * len(rest)
        for i in range(block.count)
    ]
    heads = 0
    for row in block.sample[: _SAMPLE // 2]:
        given = [cell for cell, value in zip(row, values, strict=False) if value and cell]
        units = all(is_unit(cell) or is_missing(cell) for cell in row if cell)
        if not any(not is_value(cell) for cell in given) or (
            heads and not units and any(map(looks_like_number, given))
        ):
            break
        heads += 1
    if not any(values) and block.sample:
        return 1
    return heads


def _names_above(lines: Sequence[Line], block: _Block) -> tuple[tuple[str, ...], int, tuple[str, ...], int]:
    """Names in the lines above a block of values: their row, the units, and the number of lines that they take."""
    units: tuple[str, ...] = ()
    used = 0
    for line in reversed(lines[max(0, block.start - 4) : block.start]):
        if line.remark and not any(sign.isalnum() for sign in line.text):
            continue
        cells = (_headings(line.remarked, block) if line.remark else None) or _headings(line.text, block)
        if cells is None:
            if len(_trimmed(line.cells(block.separator))) == 1:
                continue
            break
        used += not line.remark
        if not units and all(is_unit(cell) or is_missing(cell) for cell in cells):
            units = tuple(bare(cell) for cell in cells)
            continue
        return tuple(cells), line.row, units, used
    return (), 0, (), 0


def _check_above(lines: Sequence[Line], block: _Block, name: str) -> None:
    """Refuse a line of names right above the block that has another number of cells."""
    if block.separator == " " or not block.start or lines[block.start - 1].remark:
        return
    line = lines[block.start - 1]
    cells = _trimmed(line.cells(block.separator))
    if len(cells) > 1 and abs(len(cells) - block.count) == 1 and not any(map(looks_like_number, cells)):
        raise UsageError(
            f"{name}, row {line.row}: {len(cells)} names, and {block.count} values in the rows after it; correct the "
            "row, or say --header 0 if they are no names"
        )


def _headings(text: str, block: _Block) -> list[str] | None:
    """A line as names of the block's columns; None if their numbers differ, or it holds values."""
    tries = [_trimmed(split(text, block.separator))]
    tries += [[one for one in re.split(r"\s{2,}|\t", text.strip().strip('"').strip()) if one]]
    for cells in tries:
        named = cells
        if len(cells) == block.count + 1:
            named = cells[1:] if cells[0].endswith(":") else cells[:-1] if _EXTRA.fullmatch(cells[-1]) else cells
        if len(named) == block.count and not any(looks_like_number(cell) for cell in named) and all(named):
            return named
    return None
