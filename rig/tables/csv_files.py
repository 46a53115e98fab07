"""Reading and writing CSV. Defects are reported in one line: file, row, column, next step."""

from __future__ import annotations

import csv
import io
import math
import os
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np

from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.files.regular import open_regular
from rig.fitter.arrays import FloatArray
from rig.procedures.kinds import kinds
from rig.procedures.tables.table import Table
from rig.tables.behind_rows import without_evidence
from rig.tables.cells_written import cells_of
from rig.tables.of_others.file_form import NOTHING, FileForm
from rig.tables.of_others.footers import footers
from rig.tables.of_others.numbers import (
    OVERLOAD,
    Notation,
    gaps_of,
    is_missing,
    is_no_reading,
    is_overload,
    looks_like_number,
    may_have_gaps,
    maybe_gap,
    with_error,
    with_unit,
)
from rig.tables.of_others.table import TableOfOthers
from rig.tables.of_others.where_the_table_is import NoTable

_MOST_COLUMNS = 2000
_BLANK = frozenset(("\n", "\r\n", "\r"))
_LONGEST_LINE = 1 << 20
_FOOTER, _MANY = 3, 100_000
_BLOCK = 65536
"""Rows of a table that are written together."""
_MOST_NUMBERS, _MOST_CELLS = 2 << 30, 32 << 20
"""Maximum size in bytes of a table of numbers, and of one read cell by cell, which needs much more memory."""


def _regular(path: Path, most: int) -> BinaryIO:
    """A table's file, opened. Raises `UsageError`."""
    try:
        file = open_regular(path)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if os.fstat(file.fileno()).st_size > most:
        file.close()
        raise UsageError(
            f"{path} is larger than {most:,} bytes, the maximum for "
            f"{'a table' if most == _MOST_NUMBERS else 'a table that is not all finite numbers'}; leave out what is "
            "not needed"
        )
    return file


def read_csv(path: Path, asked: FileForm = NOTHING) -> Table:
    """A CSV table of numbers; of others as they come, without gaps. Raises `UsageError`."""
    return without_evidence(_of_numbers_alone(path, asked))


def _of_numbers_alone(path: Path, asked: FileForm) -> Table:
    if asked:
        return cells_of_others(path, asked).strict()
    try:
        return _read_csv(path)
    except UsageError as refusal:
        found = _of_others_alone(path, refusal)
        if found.plain:
            raise
        return found.strict()


def _of_others_alone(path: Path, refusal: UsageError) -> TableOfOthers:
    """`_of_others`; where there is a question about a table like ours, the refusal is raised instead."""
    try:
        return _of_others(path, refusal)
    except UsageError:
        if _is_like_ours(path):
            raise refusal from None
        raise


def _is_like_ours(path: Path) -> bool:
    """Whether a file has names and rows of several cells, separated by commas."""
    try:
        return len(_cells_of(path)[0]) > 1
    except UsageError:
        return False


def cells_of_others(path: Path, asked: FileForm) -> TableOfOthers:
    """A table of others. Raises `UsageError`."""
    with _regular(path, _MOST_CELLS) as file:
        return TableOfOthers.read(path, file.read(), asked)


def _of_others(path: Path, refusal: UsageError) -> TableOfOthers:
    """A table that is not like ours. Raises the refusal if there is none, or another `UsageError`."""
    try:
        return cells_of_others(path, NOTHING)
    except NoTable:
        raise refusal from None


def _read_csv(path: Path) -> Table:
    known = _all_numbers(path)
    if known is None:
        names, body = _cells_of(path)
        rows: Sequence[int] = [number for number, _ in body]
        columns = {n: np.array([_number(path, number, n, row[i]) for number, row in body]) for i, n in enumerate(names)}
    else:
        columns, rows = known
    return _table(path, columns, rows)


def _table(path: Path, columns: dict[str, FloatArray], rows: Sequence[int], **more: Any) -> Table:
    """A table of a file; simulated, if a column says so: a dry run stays one after `rig export`."""
    simulated = bool(np.any(columns.get("simulated", 0.0)))
    return Table(str(path), columns, simulated, {"file": path.name, "simulated": simulated}, rows=rows, **more)


def read_any_csv(path: Path, needed: Collection[str], asked: FileForm = NOTHING) -> Table:
    """A CSV table of any kind: columns that are not numbers are text.

    Args:
        path: the file.
        needed: required columns; rows without a value in one of them are left out, and so are other columns with
            gaps.
        asked: declarations of the user about the file.

    Raises:
        UsageError: a required column is missing, or the file can be read in several ways.
    """
    return without_evidence(_of_any_kind(path, needed, asked), needed)


def _of_any_kind(path: Path, needed: Collection[str], asked: FileForm) -> Table:
    if asked:
        return cells_of_others(path, asked).any(needed)
    try:
        table = _read_any_csv(path, needed)
    except UsageError as refusal:
        return _of_others(path, refusal).any(needed)
    numbers = [name for name in needed if name in table.text]
    if table.columns and not any(_of_numbers(table.text[name]) for name in numbers):
        return table
    try:
        return cells_of_others(path, asked).any(needed)
    except NoTable:
        return table


def _read_any_csv(path: Path, needed: Collection[str]) -> Table:
    known = _all_numbers(path)
    names, body = (list(known[0]), []) if known is not None else _cells_of(path)
    for name in needed:
        if name not in names:
            raise UsageError(f"{path}: there is no column {name!r}; it has {', '.join(names)}")
    if known is not None:
        return _table(path, known[0], known[1])
    columns, text, missing = {}, {}, {}
    for i, name in enumerate(names):
        cells = [row[i].strip() for _, row in body]
        if name not in needed and "" in cells:
            missing[name] = body[cells.index("")][0]
            continue
        if all(_is_number(cell) for cell in cells if cell):
            columns[name] = np.array([_number(path, number, name, row[i]) for number, row in body])
        else:
            gaps = [number for number, row in body if not row[i].strip()]
            if gaps:
                raise UsageError(f"{path}, row {gaps[0]}, column {name}: the value is missing; fill it in")
            text[name] = np.array(cells)
    rows = [number for number, _ in body]
    return _table(path, columns, rows, text=text, gaps=missing)


def read_gappy_csv(path: Path, numbers: Collection[str], asked: FileForm = NOTHING) -> Table:
    """A CSV table with missing values: NaN in a column of numbers, "" in one of text.

    Args:
        path: the file.
        numbers: columns of numbers, if they exist. Other columns are numbers if every value is.
        asked: declarations of the user about the file.

    Raises:
        UsageError: the file cannot be read, or one of those columns has a value that is not a number.
    """
    if not path.is_file():
        raise UsageError(f"there is no file {path}")
    if asked:
        return cells_of_others(path, asked).gappy(numbers)
    try:
        table = _read_gappy_csv(path, numbers)
    except UsageError as refusal:
        found = _of_others_alone(path, refusal)
        if found.plain and set(numbers) <= set(found.columns):
            raise
        return found.gappy(numbers)
    if set(numbers) & {*table.columns, *table.text}:
        return table
    try:
        return cells_of_others(path, asked).gappy(numbers)
    except UsageError:
        return table


def _read_gappy_csv(path: Path, numbers: Collection[str]) -> Table:
    known = _all_numbers(path)
    if known is not None:
        return _table(path, known[0], known[1])
    names, body = _cells_of(path)
    columns, text = {}, {}
    for i, name in enumerate(names):
        cells = [row[i].strip() for _, row in body]
        given = [cell for cell in cells if cell]
        if name in numbers or (given and all(_is_number(c) and math.isfinite(float(c)) for c in given)):
            columns[name] = np.array(
                [
                    _number(path, row, name, cell) if cell else math.nan
                    for (row, _), cell in zip(body, cells, strict=True)
                ]
            )
        else:
            text[name] = np.array(cells)
    return _table(path, columns, [number for number, _ in body], text=text)


def read_seen_csv(path: Path, asked: FileForm = NOTHING) -> Table:
    """All columns and rows of any table, NaN and "" for missing values, by its look alone. Raises `UsageError`."""
    try:
        seen = cells_of_others(path, asked).gappy()
    except NoTable:
        if asked:
            raise
        seen = _read_gappy_csv(path, ())
    return without_evidence(seen)


def _of_numbers(cells: Iterable[str]) -> bool:
    """Whether a column of text is one of numbers in another notation, with words for none, units or errors."""
    given = [cell for cell in cells if not is_missing(cell) and not is_no_reading(cell)]
    return bool(given) and all(looks_like_number(cell) or with_unit(cell)[0] or with_error(cell)[0] for cell in given)


def _all_numbers(path: Path) -> tuple[dict[str, FloatArray], Sequence[int]] | None:
    """Columns of a table that has only finite numbers, and `Table.rows`; None if it must be read cell by cell.

    NumPy reads a million rows in a fifth of the time and a tenth of the memory, but does not report the place of a
    defect.
    """
    try:
        with (
            _regular(path, _MOST_NUMBERS) as raw,
            io.TextIOWrapper(raw, encoding="utf-8-sig", newline="") as file,
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("error")  # no rows
            names = [name.strip() for name in file.readline(_LONGEST_LINE).split(",")]
            if len(names) > _MOST_COLUMNS:
                return None
            blank: list[int] = []
            values = np.loadtxt(_noting_blank(file, blank), np.float64, delimiter=",", comments=None, ndmin=2)
    except (ValueError, UserWarning):
        return None
    named = len(set(names)) == len(names) == values.shape[1] and all(name and '"' not in name for name in names)
    if not named or not np.isfinite(values).all() or (np.abs(values) >= OVERLOAD).any():
        return None
    last = len(values) + len(blank) + 1
    if any(last - _FOOTER <= row < last for row in blank) and len(values) < _MANY:
        return None  # there may be a row of means or sums after the blank line
    rows = np.setdiff1d(np.arange(len(values) + len(blank)) + 2, blank).tolist() if blank else ()
    columns = np.ascontiguousarray(values.T)
    if may_have_gaps(columns.min(axis=1), columns.max(axis=1)) and any(map(gaps_of, columns)):
        return None
    columns.flags.writeable = False  # so that the data of a kind need no copy
    return dict(zip(names, columns, strict=True)), rows


def _noting_blank(lines: Iterable[str], blank: list[int]) -> Iterator[str]:
    """The lines of a file after its first. NumPy skips blank ones; their numbers are put into `blank`."""
    for number, line in enumerate(lines, start=2):
        if line in _BLANK:
            blank.append(number)
        yield line


def _cells_of(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Column names, and (row number, cells) of every row."""
    try:
        with _regular(path, _MOST_CELLS) as file:
            text = file.read().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is neither a run file nor UTF-8 text (byte {error.start})") from error
    if "\0" in text:
        raise UsageError(f"{path} is not a CSV table: there is a NUL in it")
    try:
        lines = csv.reader(io.StringIO(text), strict=True)
        first = next(lines, [])
        if len(first) > _MOST_COLUMNS:
            raise UsageError(f"{path} has {len(first):,} columns; the maximum is {_MOST_COLUMNS:,}")
        rows = [first, *lines]
    except csv.Error as error:
        raise UsageError(f"{path} is not a CSV table: {error}") from error
    if not rows or not any(cell.strip() for cell in rows[0]):
        tables = "; ".join(kind.described for kind in kinds().values())
        raise UsageError(f"{path} is empty: the first line must name the columns; {tables}")
    names = [cell.strip() for cell in rows[0]]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{path}, row 1: column {name!r} occurs twice; rename one")
    body = [(number, row) for number, row in enumerate(rows[1:], start=2) if any(cell.strip() for cell in row)]
    if not body:
        raise UsageError(f"{path} has column names and no rows")
    for number, row in body:
        if len(row) != len(names):
            raise UsageError(f"{path}, row {number}: {len(row)} values for {len(names)} columns; correct the row")
    if not all(names) and any(row[names.index("")].strip() for _, row in body):
        raise UsageError(f"{path}, row 1: a column has no name; give it one")
    for number, row in body:
        if any(is_overload(cell.strip()) for cell in row):
            raise UsageError(f"{path}, row {number}: 9.9E37 is the overload of a meter, not a value; remove the row")
    for i, name in enumerate(names):
        cells = [row[i].strip() for _, row in body]
        if any(map(maybe_gap, cells)):
            gaps = gaps_of(np.array([_float(cell) if _is_number(cell) else math.nan for cell in cells]))
            if gaps:
                raise UsageError(
                    f"{path}, column {name}: {gaps[0]:g} stands for no value among its numbers; leave the cell empty"
                )
    _no_footers(path, names, body)
    return names, body


def _no_footers(path: Path, names: Sequence[str], body: Sequence[tuple[int, list[str]]]) -> None:
    """Refuse rows that are no observations: then the table is read as one of others, which says what it leaves out."""
    apart = [i > 0 and number > body[i - 1][0] + 1 for i, (number, _) in enumerate(body)]
    cells = [[cell.strip() for cell in row] for _, row in body]
    found = footers(names, cells, apart, Notation(), lambda i: f"{path}, row {body[i][0]}")
    for i, cell in found.items():
        raise UsageError(f"{path}, row {body[i][0]}: {cell[:40]!r} shows that it is no observation; remove the row")


def _is_number(cell: str) -> bool:
    try:
        _float(cell)
    except ValueError:
        return False
    return True


def _float(cell: str) -> float:
    """A number in the notation of other programs; Python would also accept underscores, as in 1_5."""
    if "_" in cell or not cell.isascii():
        raise ValueError("no number")
    return float(cell)


def _number(path: Path, row: int, column: str, cell: str) -> float:
    what = f"{path}, row {row}, column {column}"
    try:
        value = _float(cell)
    except ValueError:
        if not cell.strip():
            raise UsageError(f"{what}: the value is missing; fill it in or remove the row") from None
        raise UsageError(f"{what}: {cell.strip()!r} is not a number") from None
    if not math.isfinite(value):
        raise UsageError(f"{what}: {cell.strip()} is not a finite number; remove the row if there was no reading")
    return value


def write_csv(columns: Mapping[str, Sequence[float] | np.ndarray[Any, Any]], path: Path) -> None:
    """Write a table of numbers and text completely or not at all. Raises `UsageError` if the disk refuses."""

    def rows(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        longest = max((len(values) for values in columns.values()), default=0)
        for start in range(0, longest, _BLOCK):
            # By column, and joined: a call for each cell, and `csv` for each row, took most of a long table's time.
            made = [cells_of(values[start : start + _BLOCK]) for values in columns.values()]
            block = zip(*(cells for cells, _ in made), strict=True)
            if len(made) > 1 and all(plain for _, plain in made):
                file.writelines(",".join(row) + "\n" for row in block)
            else:
                writer.writerows(block)

    write_whole(path, rows)
