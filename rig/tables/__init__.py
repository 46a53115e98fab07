"""Tables in and out: CSV with units in the column names, and the observations of a run file."""

from pathlib import Path

from procedures.attitude.table import PITCH_ROLL, attitude_data
from procedures.pressure.table import WHOLE_PLOT, whole_plot_data
from procedures.table import Table
from rig.errors import UsageError
from rig.regular import open_regular
from rig.tables.csv_tables import read_any_csv, read_csv, read_gappy_csv, write_csv
from rig.tables.observations import run_table

__all__ = [
    "PITCH_ROLL",
    "WHOLE_PLOT",
    "Table",
    "attitude_data",
    "read_any_csv",
    "read_gappy_csv",
    "read_table",
    "run_table",
    "whole_plot_data",
    "write_csv",
]


def read_table(path: Path) -> Table:
    """A CSV file or the accepted observations of a run file. Raises `UsageError` or `RunFileError`."""
    if not path.exists():
        raise UsageError(f"there is no file {path}")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a CSV file or a run file")
    try:
        with open_regular(path) as file:
            start = file.read(16)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if start.startswith(b"SQLite format 3"):
        return run_table(path)
    return read_csv(path)
