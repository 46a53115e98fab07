"""Reading and writing tables: CSV with units in the column names, and the observations of a run file."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.files.regular import open_regular
from rig.procedures.tables.table import Table
from rig.procedures.tables.within import Within
from rig.tables.csv_files import read_any_csv, read_csv, read_gappy_csv, read_seen_csv, write_csv
from rig.tables.of_others.file_form import NOTHING, FileForm
from rig.tables.sizes import usable

__all__ = [
    "FileForm",
    "FileSource",
    "Table",
    "is_run",
    "read_any_csv",
    "read_gappy_csv",
    "read_table",
    "write_csv",
]


def is_run(path: Path) -> bool:
    """Whether a file is a run file, otherwise treated as a CSV table. Raises `UsageError` if it does not exist."""
    if not path.exists():
        raise UsageError(f"there is no file {path}")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a CSV file or a run file")
    try:
        with open_regular(path) as file:
            start = file.read(16)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    return start.startswith(b"SQLite format 3")


def read_table(path: Path, asked: FileForm = NOTHING) -> Table:
    """A table from a CSV file or from the accepted observations of a run file. Raises `UsageError` or
    `RunFileError`.
    """
    if not is_run(path):
        return read_csv(path, asked)
    from rig.tables.table_of_run import run_table  # noqa: PLC0415 - a CSV table needs nothing of run files

    return run_table(path)


@dataclass(frozen=True)
class FileSource:
    """A run file, or a CSV file, read at its first use. See `rig.procedures.evaluate.results.Source`.

    Attributes:
        path: the file.
        asked: declarations of the user about a CSV file.
    """

    path: Path
    asked: FileForm = NOTHING
    _read: list[Table] = field(default_factory=list, repr=False, compare=False)

    @property
    def name(self) -> str:
        """Its path."""
        return str(self.path)

    @property
    def is_run(self) -> bool:
        """Whether it is a run file. Raises `UsageError` if there is no such file."""
        return is_run(self.path)

    @cached_property
    def table(self) -> Table:
        """The whole table. Raises `UsageError` or `RunFileError`."""
        return self._kept(usable(read_table(self.path, self.asked)))

    def read(self, needed: Collection[str]) -> Table:
        """Any CSV table. Raises `UsageError`."""
        return self._kept(usable(read_any_csv(self.path, needed, self.asked), needed))

    def all_columns(self) -> Table:
        """All columns and rows of any CSV table; NaN and "" for missing values. Raises `UsageError`."""
        return read_seen_csv(self.path, self.asked)

    @property
    def understood(self) -> Mapping[str, Any]:
        """How the table read last was understood; {} for our own tables."""
        return self._read[-1].understood if self._read else {}

    @property
    def within(self) -> Mapping[str, Within]:
        """Readings of which the rows of the table read last are means, by column."""
        return self._read[-1].within if self._read else {}

    def _kept(self, table: Table) -> Table:
        self._read[:] = [table]
        return table
