"""Where the table is in a file: its separator, its names and units, and the first and last of its rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rig.errors import UsageError
from rig.tables.of_others.block import Block, block_of, is_data, trimmed
from rig.tables.of_others.cells_of_lines import Line
from rig.tables.of_others.file_form import SEPARATORS, FileForm
from rig.tables.of_others.heads import Heads, heads_of
from rig.tables.of_others.numbers import is_missing, is_time, is_value, looks_like_number
from rig.tables.of_others.pairs import with_pairs

__all__ = ["NO_SEPARATOR", "Layout", "NoTable", "is_time", "is_value", "layout_of"]

NO_SEPARATOR = "\n"
"""What separates the cells of a table of one column: nothing in a line does."""
_ALIKE = 0.02
_FEW, _MANY, _TAIL, _HEADS, _LONGEST = 2, 4, 20, 40, 10_000


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
        processing: rows that say how a logger made the values.
        units_row: row of the units in the file; 0 without.
        constants: numbers above the table, by name.
        groups: row of names of groups, which are a part of the names; 0 without.
        pairs: whether each value stands beside its name, and `after` are all lines that have none.
        again: rows above which the file begins anew: its heads once more.
    """

    separator: str
    names: tuple[str, ...]
    header: int
    units: tuple[str, ...]
    body: Sequence[Line]
    before: int
    after: tuple[int, ...]
    earlier: int = 0
    processing: tuple[int, ...] = ()
    units_row: int = 0
    constants: Mapping[str, str] = field(default_factory=dict)
    again: tuple[int, ...] = ()
    pairs: bool = False
    groups: int = 0


def layout_of(lines: Sequence[Line], name: str, asked: FileForm) -> Layout:
    """The layout of a file.

    Args:
        lines: of the file, none blank.
        name: of the file, for messages.
        asked: declarations of the user.

    Raises:
        UsageError: there is no table, or it can be read in several ways.
    """
    if asked.header and all(line.row != asked.header for line in lines):
        raise UsageError(
            f"{name}: --header {asked.header}: this row is blank, or there is none; the last one is "
            f"{lines[-1].row if lines else 0}"
        )
    tried = [asked.separator] if asked.separator else list(SEPARATORS.values())
    if not asked.separator and asked.header is None and (log := with_pairs(lines)) is not None:
        rows = {line.row for line in log[1]}
        left = tuple(line.row for line in lines if not line.remark and line.row not in rows)
        return Layout("\t", log[0], 0, (), log[1], 0, left, pairs=True)
    lines, again = _once(lines)
    if (alone := _one_column(lines, name, asked)) is not None:
        return alone
    found = [(_merit(block), block) for separator in tried if (block := block_of(lines, separator, asked))]
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
    heads = heads_of(lines, best, name, asked)
    top = min(heads.top, best.start)
    _check_only(lines, best, heads, name, asked)
    before = sum(1 for line in lines[: heads.top] if not line.remark)
    return Layout(
        best.separator, heads.names or ("",) * best.count, heads.row, heads.units, best.lines[heads.start :], before,
        best.after, _earlier(lines[:top], best.separator), heads.processing, heads.units_row, heads.constants, again,
        groups=heads.groups,
    )  # fmt: skip


def _one_column(lines: Sequence[Line], name: str, asked: FileForm) -> Layout | None:
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
    first = body[0].cells(NO_SEPARATOR)[0]
    if not (is_missing(first) or looks_like_number(first)):
        return None
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


def _once(lines: Sequence[Line]) -> tuple[Sequence[Line], tuple[int, ...]]:
    """Lines without those that repeat the first ones, as a logger writes that was started again; and their rows."""
    heads: dict[str, int] = {}
    for line in lines[:_HEADS]:
        if len(line.text) > _LONGEST:
            return lines, ()
        parts = next((cells for sign in SEPARATORS.values() if len(cells := line.cells(sign)) > 1 and sign != " "), [])
        given = [cell for cell in parts if cell]
        if sum(map(is_value, given)) * 2 > len(given):
            break
        if len(given) > 1 and (not any(map(is_value, given)) or given[0] == "TOA5"):
            heads.setdefault(line.text, line.row)
    else:
        return lines, ()
    again = tuple(line.row for line in lines if heads.get(line.text, line.row) != line.row)
    if not again:
        return lines, ()
    gone, last = set(again), True
    for line in lines:
        if line.row in gone and not last:
            return lines, ()  # between the tables stands something else: they are not one
        last = line.remark or line.row in gone or line.text in heads or _mostly(line)
    return [line for line in lines if line.row not in gone], again


def _mostly(line: Line) -> bool:
    """Whether most cells of a line are values, with one of the separators."""
    for sign in SEPARATORS.values():
        given = [cell for cell in line.cells(sign) if cell] if sign != " " else []
        if len(given) > 1 and 2 * sum(map(is_value, given)) > len(given):
            return True
    return False


def _check_only(lines: Sequence[Line], block: Block, heads: Heads, name: str, asked: FileForm) -> None:
    """Refuse other rows of values before the block, unless the user says where its names are."""
    if asked.header:
        return
    above = [line for line in lines[: min(heads.top, block.start)] if not line.remark]
    values = [line for line in above if is_data(line.cells(block.separator))]
    if asked.header != 0 and above and not heads.names:
        _check_above(lines, block, name)
        cells = trimmed(above[-1].cells(block.separator))
        if len(cells) > 1 and any(looks_like_number(cell) for cell in cells):
            raise UsageError(
                f"{name}, row {above[-1].row}: {len(cells)} values, and {block.count} in the rows after it; correct "
                "the row, or say --header 0 if it does not belong to the table"
            )
    alike = [line for line in values if len(trimmed(line.cells(block.separator))) == block.count]
    names = next((line.text for line in lines if line.row == heads.row), None)
    if len(alike) > _FEW or (alike and names in [line.text for line in above]):
        raise UsageError(
            f"{name} holds several tables: one ends in row {alike[-1].row}, another begins in row "
            f"{block.lines[0].row}; make a file of each, or say --header for the last one"
        )


def _merit(block: Block) -> float:
    """The share of cells that are values, from 0 to 1."""
    cells = [cell for row in block.sample[1:] or block.sample for cell in row]
    return sum(1 for cell in cells if is_value(cell)) / max(len(cells), 1) * min(1.0, (len(block.lines) + 1) / 4)


def _same(one: Block, other: Block) -> bool:
    """Whether two separators give the same cells."""
    rows = ([[cell for cell in row if cell] for row in block.sample[-_TAIL:]] for block in (one, other))
    return next(rows) == next(rows)


def _check_above(lines: Sequence[Line], block: Block, name: str) -> None:
    """Refuse a line of names right above the block that has another number of cells."""
    if block.separator == " " or not block.start or lines[block.start - 1].remark:
        return
    line = lines[block.start - 1]
    cells = trimmed(line.cells(block.separator))
    if len(cells) > 1 and len(cells) != block.count and not any(map(looks_like_number, cells)):
        raise UsageError(
            f"{name}, row {line.row}: {len(cells)} names, and {block.count} values in the rows after it; correct the "
            "row, or say --header 0 if they are no names"
        )
