"""The block of a file's lines that holds its table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rig.tables.of_others.cells_of_lines import Line
from rig.tables.of_others.file_form import FileForm
from rig.tables.of_others.numbers import is_value, looks_like_number

MOST_COLUMNS = 2000
_SAMPLE, _TAIL, _WIDE = 400, 20, 3


@dataclass(frozen=True)
class Block:
    """Neighbouring lines with the same number of cells.

    Attributes:
        separator: between cells.
        count: number of cells, without blank ones at the end of all lines.
        raw: the same with them.
        start: index of the first line.
        lines: without remarks.
        after: rows of lines after it.
        sample: cells of some of the lines.
    """

    separator: str
    count: int
    raw: int
    start: int
    lines: Sequence[Line]
    after: tuple[int, ...]
    sample: Sequence[list[str]]


def block_of(lines: Sequence[Line], separator: str, asked: FileForm) -> Block | None:
    """The last and longest block of lines with two cells or more; None if there is none."""
    plain = [(i, line) for i, line in enumerate(lines) if not line.remark]
    if asked.header is not None:
        plain = [(i, line) for i, line in plain if line.row >= asked.header]
    if not plain:
        return None
    cells = [line.cells(separator) for _, line in plain]
    every = [len(trimmed(row)) for row in cells]
    end = len(plain)
    while end and len(cells[end - 1]) <= 1:
        end -= 1
    raw = [len(row) for row in cells]
    if max(raw) > MOST_COLUMNS:
        return None
    run = end
    while run > end - _TAIL and run and _mostly_values(cells[run - 1]) and raw[run - 1] == raw[end - 1]:
        run -= 1
    tail = range(max(run if end - run > 1 else 0, end - _TAIL), end)
    usual = max((raw[i] for i in tail), key=[raw[i] for i in tail].count, default=0)
    most = max((every[i] for i in tail if raw[i] == usual), default=0)
    while end and raw[end - 1] != usual and every[end - 1] < most and not is_value(cells[end - 1][0]):
        end -= 1  # words in a line of its own form, under the table
    begin = end
    while begin and (
        raw[begin - 1] == usual or every[begin - 1] == most or (every[begin - 1] < most and is_data(cells[begin - 1]))
    ):
        begin -= 1
    count = max((every[i] for i in range(begin, end) if raw[i] == usual or every[i] == most), default=0)
    if count > MOST_COLUMNS:
        return None
    begin, count = _wider(cells, begin, end, count)
    if count < 2 or count > MOST_COLUMNS or begin == end:
        return None
    taken = [line for _, line in plain[begin:end]]
    sample = [line.cells(separator) for line in (taken[: _SAMPLE // 2] + taken[_SAMPLE // 2 :][-_SAMPLE // 2 :])]
    after = tuple(line.row for _, line in plain[end:])
    return Block(separator, count, usual, plain[begin][0], taken, after, sample)


def _mostly_values(cells: Sequence[str]) -> bool:
    """Whether a line has several cells, and more values than words."""
    given = [cell for cell in cells if cell]
    return len(given) > 1 and 2 * sum(map(is_value, given)) > len(given)


def _wider(cells: Sequence[list[str]], begin: int, end: int, count: int) -> tuple[int, int]:
    """First line and number of cells, where the names and a few rows of values under them have more than the others.

    A logger writes its serial number in the first row alone: the others are short by their last cells.
    """
    top = begin - 1
    if begin == end or sum(map(is_value, cells[begin])) * 2 <= len(cells[begin]):
        return begin, count
    while top > max(0, begin - 1 - _WIDE) and sum(map(is_value, cells[top])) * 2 > len(cells[top]):
        top -= 1
    wide = range(top, begin)
    width = len(cells[top]) if wide else 0
    named = width > count and not any(map(looks_like_number, cells[top])) and all(cells[top])
    if len(wide) > 1 and named and all(len(cells[i]) == width for i in wide):
        return top, width
    return begin, count


def is_data(cells: Sequence[str]) -> bool:
    """Whether a line has several cells, and nothing but values."""
    return len(cells) > 1 and all(is_value(cell) for cell in cells)


def trimmed(cells: list[str]) -> list[str]:
    """Cells without blank ones at the end."""
    end = len(cells)
    while end and not cells[end - 1]:
        end -= 1
    return cells[:end]
