"""The rows above the values of a table: names, units, how a logger made the values, constants."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, takewhile

from rig.errors import UsageError
from rig.tables.of_others.block import Block, trimmed
from rig.tables.of_others.cells_of_lines import Line, split
from rig.tables.of_others.file_form import FileForm
from rig.tables.of_others.numbers import is_missing, is_no_reading, is_value, looks_like_number
from rig.units.in_tables import bare, is_unit, no_unit

_EXTRA = re.compile(r"comments?|notes?|remarks?", re.IGNORECASE)
_PROCESSING = re.compile(
    r"smp|sample|avg|average|mean|tot|total|max|min|std|med|wvc|mmt|cov|tmx|tmn|instant|inst", re.IGNORECASE
)
"""The processing of a logger: names of Campbell Scientific for what stands between two rows, and words like them."""
_OF_FILE = re.compile(
    r"TOA5|TOB\d|TOACI1|source|record length|vendor|model(?: number)?|firmware(?: version)?|"
    r"serial(?: (?:no\.?|number))?|operator|instrument|software(?: version)?|file ?name|.*:",
    re.IGNORECASE,
)
_HIGHEST, _FIRST = 10, 200
_WORDS, _MIXED, _VALUES, _SPARSE = "words", "mixed", "values", "sparse"


@dataclass(frozen=True)
class Heads:
    """Rows above the values.

    Attributes:
        names: of the columns; () without.
        row: of the names in the file; 0 without.
        top: index among the file's lines of the first of these rows.
        start: number of the block's lines that are no values.
        units: of the columns; () without.
        processing: rows that say how the logger made the values.
        units_row: row of the units in the file; 0 without.
        constants: numbers in the row of units, by the name above them, where no column follows.
        groups: row of names of groups, which are a part of the names; 0 without.
    """

    names: tuple[str, ...]
    row: int
    top: int
    start: int
    units: tuple[str, ...] = ()
    processing: tuple[int, ...] = ()
    units_row: int = 0
    constants: Mapping[str, str] = field(default_factory=dict)
    groups: int = 0


def heads_of(lines: Sequence[Line], block: Block, name: str, asked: FileForm) -> Heads:
    """The rows above the values of a block.

    Args:
        lines: of the file.
        block: of lines that holds the values.
        name: of the file, for messages.
        asked: declarations of the user.

    Raises:
        UsageError: two rows may hold the names, or there are more names than columns, or fewer.
    """
    if asked.header == 0:
        return Heads((), 0, block.start, 0)
    walk = _Walk(lines, block, _value_columns(block))
    if asked.header:
        return walk.at(asked.header, name)
    found = walk.up(name)
    if found.names:
        walk.check_single(found, name)
    return found


class _Walk:
    """The way up from the first row of values, for `heads_of`."""

    def __init__(self, lines: Sequence[Line], block: Block, values: Sequence[int]) -> None:
        self.lines, self.block, self.values = lines, block, values
        self.inside = {line.row: i for i, line in enumerate(block.lines[:_FIRST])}
        first = next((i for i in self.inside.values() if self._sort(self._cells(block.lines[i])) == _VALUES), 0)
        if not values:
            first = 1  # nothing but text: the first row has the names
        last = len(block.lines) - 1
        row = block.lines[first].row if first <= last else block.lines[last].row + 1
        self.end = next((i for i, line in enumerate(lines) if line.row >= row), len(lines))

    def up(self, name: str) -> Heads:
        """The nearest row of names above the values, and what stands between. Raises `UsageError`."""
        marked: list[tuple[int, str]] = []
        tried = 0
        for i in range(self.end - 1, -1, -1):
            line = self.lines[i]
            if line.remark and not any(sign.isalnum() for sign in line.text):
                continue
            tried += 1
            if tried > _HIGHEST:
                break
            cells = self._cells(line)
            mark = self._mark(cells) if not any(what == "units" for _, what in marked) else ""
            if mark == "units" and self._fewer_above(i, cells):
                mark = ""  # the names of single columns, under names of groups of them
            if mark:
                marked.append((i, mark))
                continue
            if self._names(i, under_units=bool(marked)) is not None:
                return self._heads(i, marked)
            if line.row in self.inside and self._sort(cells) in (_MIXED, _SPARSE):
                marked = []
                continue
            if len([cell for cell in trimmed(self._plain(line)) if cell]) > 1:
                break
        if marked and any(self.lines[i].row in self.inside for i, _ in marked):  # units that are names: V, A
            return self._heads(marked[-1][0], marked[:-1])
        if marked and (names := self._numbered(marked[-1][0])):
            return self._heads(marked[-1][0], marked[:-1], names)
        self._check_first(name)
        return Heads((), 0, self.block.start, 0)

    def _numbered(self, i: int) -> list[str]:
        """Names in a line that looks like a remark because the rows are numbered under "#", beside units: #, kN, V."""
        line = self.lines[i]
        cells = trimmed(split(line.text, self.block.separator)) if line.remark else []
        return cells if len(cells) == self.block.count and cells[0].strip() == "#" and self._full(cells) else []

    def _check_first(self, name: str) -> None:
        """Refuse a first row that may have numbers for names, as of wavelengths. Raises `UsageError`."""
        first, others = self.block.sample[0], self.block.sample[1:]
        numbers = [first[i] for i in self.values if i < len(first)]
        texts = len(trimmed(list(first))) > len(numbers)
        below = [row[i] for row in others for i in self.values if i < len(row)]
        whole = all(cell.isdigit() for cell in numbers) and not all(cell.lstrip("+-").isdigit() for cell in below)
        if len(numbers) > 1 and texts and whole and len(set(numbers)) == len(numbers) and _rising(numbers):
            row = self.block.lines[0].row
            raise UsageError(
                f"{name}, row {row}: {', '.join(numbers[:3])} may be names of columns, or values; say --header {row} "
                "or --header 0"
            )

    def _fewer_above(self, i: int, cells: Sequence[str]) -> bool:
        """Whether the row above has words for some columns only, and this one for more."""
        above = self._plain(self.lines[i - 1]) if i and not self.lines[i - 1].remark else []
        given = sum(map(bool, above))
        return 1 < given < sum(map(bool, cells)) and len(above) >= self.block.count

    def at(self, row: int, name: str) -> Heads:
        """The row of names that the user declared, and what follows it. Raises `UsageError`."""
        at = next(i for i, line in enumerate(self.lines) if line.row == row)
        line = self.lines[at]
        cells = (self._headings(line.remarked) if line.remark else None) or trimmed(self._plain(line))
        width = max(self.block.count, self.block.raw)
        if len(cells) < self.block.count and line.row not in self.inside:
            raise UsageError(
                f"{name}, row {row}: {len(cells)} names, and {self.block.count} values in the rows after it; correct "
                "the row, or say another --header"
            )
        if len(cells) > self.block.count and width == self.block.count:
            raise UsageError(
                f"{name}, row {row}: {len(cells)} names, and {self.block.count} values in the rows after it; correct "
                "the row, or say another --header"
            )
        marked: list[tuple[int, str]] = []
        for i in range(at + 1, len(self.lines)):
            line = self.lines[i]
            if line.remark:
                continue
            if not (mark := self._mark(self._cells(line))):
                if self._sort(self._cells(line)) == _WORDS and self._full(self._plain(line)):
                    raise UsageError(
                        f"{name}, row {line.row}: {self._plain(line)[0]!r} is not a value; are there two rows of names?"
                    )
                break
            marked.append((i, mark))
        return self._heads(at, marked[::-1], cells)

    def check_single(self, found: Heads, name: str) -> None:
        """Refuse another row above the names that may hold them as well."""
        i = found.top
        if self.lines[i].remark or self.lines[i].apart or i == 0 or self.lines[i - 1].remark:
            return
        above = trimmed(self._plain(self.lines[i - 1]))
        if len(above) > len(found.names) or self._sort(self._cells(self.lines[i - 1])) != _WORDS:
            return
        mine, given = trimmed(list(found.names)), [cell for cell in above if cell]
        doubtful = self._full(above, len(mine)) if self._full(mine) else len(given) >= len([one for one in mine if one])
        if doubtful and len(given) > 1 and not _says_of_itself(above):
            raise UsageError(
                f"{name}: rows {self.lines[i - 1].row} and {found.row} may both hold the names of the columns; say "
                "--header with the row"
            )

    def _heads(self, at: int, marked: Sequence[tuple[int, str]], cells: Sequence[str] | None = None) -> Heads:
        names = list(cells or self._names(at, under_units=True) or trimmed(self._plain(self.lines[at])))
        names += [""] * (self.block.count - len(names))
        units: tuple[str, ...] = ()
        constants: dict[str, str] = {}
        for i, mark in marked:
            if mark == "units":
                line = self.lines[i]
                row = (self._headings(line.remarked) if line.remark else None) or self._plain(line)
                extra = zip(names[self.block.count :], row[self.block.count :], strict=False)
                constants = {one: cell for one, cell in extra if one and looks_like_number(cell)}
                row = [*row[: self.block.count], *[""] * len(names)][: len(names)]
                units = tuple(bare(cell) if is_unit(cell) else "" for cell in row)
        names = names[: self.block.count] if constants else names
        last = max([at, *(i for i, _ in marked)])
        start = max((k + 1 for row, k in self.inside.items() if row <= self.lines[last].row), default=0)
        processing = tuple(self.lines[i].row for i, mark in marked if mark == "processing")[::-1]
        of_units = next((self.lines[i].row for i, mark in marked if mark == "units"), 0)
        units = units[: len(names)]
        names, groups = self._grouped(at, names)
        top = at - 1 if groups else at
        return Heads(tuple(names), self.lines[at].row, top, start, units, processing, of_units, constants, groups)

    def _grouped(self, at: int, names: list[str]) -> tuple[list[str], int]:
        """Names with those of their groups, from the row above, where they occur twice; and that row, 0 without."""
        twice = {name for name in names if name and names.count(name) > 1}
        if not twice or not at or self.lines[at].apart or self.lines[at - 1].remark:
            return names, 0
        cells = trimmed(self._plain(self.lines[at - 1]))
        given = [cell for cell in cells if cell]
        if len(given) < 2 or len(cells) > len(names) or any(map(is_value, given)) or _says_of_itself(cells):
            return names, 0
        found, group = [], ""
        for i, name in enumerate(names):
            group = cells[i] if i < len(cells) and cells[i] else group
            found.append(f"{group} {name}".strip() if name in twice else name)
        return (found, self.lines[at - 1].row) if len(set(found)) == len(found) else (names, 0)

    def _plain(self, line: Line) -> list[str]:
        return line.cells(self.block.separator)

    def _cells(self, line: Line) -> list[str]:
        """The cells of the block's columns."""
        cells = (self._headings(line.remarked) if line.remark else None) or self._headings(line.text)
        cells = cells or self._plain(line)
        return [*cells[: self.block.count], *[""] * (self.block.count - len(cells))]

    def _sort(self, cells: Sequence[str]) -> str:
        """The content of a row in the columns of values."""
        if not self.values:
            return _WORDS
        given = [cells[i] for i in self.values if cells[i]]
        words = [cell for cell in given if not is_value(cell)]
        numbers = [cell for cell in given if is_value(cell) and not is_missing(cell) and not is_no_reading(cell)]
        if words:
            return _MIXED if numbers else _WORDS
        return _VALUES if 2 * len(given) >= len(self.values) else _SPARSE

    def _mark(self, cells: Sequence[str]) -> str:
        """Whether a row has units, or says how the values were made; "" for any other."""
        given = [cell for cell in cells if cell and not is_missing(cell)]
        if not given or self._sort(cells) in (_MIXED, _VALUES):
            return ""
        if all(_PROCESSING.fullmatch(cell) for cell in given):
            return "processing"
        known = sum(map(is_unit, given))
        bracketed = any(cell[0] in "[(" and is_unit(cell) for cell in given)
        others = [cell for cell in given if not is_unit(cell)]
        if given[0].upper() in ("NO.", "TS"):  # rows of Graphtec and Campbell Scientific repeat the word for time
            others = [cell for cell in others if cell.lower() not in ("time", "date", "date&time")]
            known += all(map(no_unit, others))
        return "units" if known and (not others or bracketed or all(map(no_unit, others))) else ""

    def _names(self, i: int, *, under_units: bool) -> list[str] | None:
        """A row as names of the columns; None if it cannot hold them."""
        line, count = self.lines[i], self.block.count
        inside = line.row in self.inside
        cells = trimmed(self._plain(line))
        if line.remark or not inside:
            tried = (self._headings(line.remarked) if line.remark else None) or self._headings(line.text)
            if tried is None:
                short = line.remark or not count < len(cells) or self.block.raw <= count or not all(cells[:count])
                if short or self._sort(cells) not in (_WORDS, _MIXED):
                    return None
                tried = cells
            cells = tried
        padded = [*cells, *[""] * (count - len(cells))]
        sort = self._sort(padded)
        if sort == _WORDS:
            return cells if sum(map(bool, cells)) > 1 or count == len(self.values) == 1 or _is_pair(cells) else None
        if sort != _MIXED:
            return None
        if not under_units and not line.apart:
            above = takewhile(lambda one: not one.remark, reversed(self.lines[:i]))
            full = next((own for own in map(self._cells, above) if self._sort(own) != _MIXED), None)
            if full is not None and self._sort(full) == _WORDS and self._full(full):
                return None  # an observation with a word in it, under the names
        return cells if self._full(cells, count) and _rising(cells) else None

    def _full(self, cells: Sequence[str], count: int = 0) -> bool:
        """Whether each column has a name of its own."""
        own = trimmed(list(cells))
        return bool(own) and len(own) >= count and all(own) and len(set(own)) == len(own)

    def _headings(self, text: str) -> list[str] | None:
        """A line as names of the block's columns; None if their numbers differ, or it holds values."""
        count = self.block.count
        tries = [trimmed(split(text, self.block.separator))]
        apart = [one for one in re.split(r"\s{2,}|\t", text.strip().strip('"').strip()) if one]
        if self.block.separator == " " or not any(self.block.separator in one for one in apart):
            tries.append(apart)  # blanks beside separators part nothing
        for cells in tries:
            named = cells
            if len(cells) == count + 1:
                named = cells[1:] if cells[0].endswith(":") else cells[:-1] if _EXTRA.fullmatch(cells[-1]) else cells
            if len(named) == count and not any(looks_like_number(cell) for cell in named) and all(named):
                return named
            if len(cells) == count - 1 > 1 and all(cells) and self._of_rows and not any(map(looks_like_number, cells)):
                return ["", *cells]
        return None

    @cached_property
    def _of_rows(self) -> bool:
        """Whether the first column holds numbers of rows, which R writes without a name of their own."""
        rows = self.block.sample[1:3]  # the first one may be that of the names
        return (
            len(rows) == 2 and rows[0][0].isdigit() and rows[1][0].isdigit() and int(rows[1][0]) - int(rows[0][0]) == 1
        )


def _is_pair(cells: Sequence[str]) -> bool:
    """Whether names are those of an index and one value: ",y"."""
    return len(cells) == 2 and bool(cells[1])


def _rising(cells: Sequence[str]) -> bool:
    """Whether the numbers among names are whole or rise or fall, as those of wavelengths and channels do."""
    try:
        numbers = [float(cell.replace(",", ".")) for cell in cells if looks_like_number(cell)]
    except ValueError:
        return False
    steps = [b - a for a, b in pairwise(numbers)]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def _says_of_itself(cells: Sequence[str]) -> bool:
    """Whether a row describes the file: by a word before a colon, or one that names no column."""
    return _OF_FILE.fullmatch(cells[0]) is not None


def _value_columns(block: Block) -> list[int]:
    """Columns of which most cells are values, below the first rows or in the lower half."""
    found: set[int] = set()
    for skip in (min(3, len(block.sample) - 1), len(block.sample) // 2):
        rest = block.sample[skip:]
        for i in range(block.count):
            given = sum(1 for row in rest if i < len(row) and is_value(row[i]) and not is_missing(row[i]))
            if given > 0.5 * len(rest):
                found.add(i)
    return sorted(found)
