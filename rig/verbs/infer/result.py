"""`rig infer`: a calibration in use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape

from rig.files.atomic import check_files, check_format
from rig.options_of_kinds import options_of
from rig.procedures.present.blocks import Block, Line, simulated_mark
from rig.procedures.present.joined import once
from rig.procedures.tables.unused import sentences
from rig.tables import FileForm
from rig.tables.csv_files import write_csv
from rig.tables.given import table_given
from rig.tables.of_others.file_form import NOTHING
from rig.verbs import infer as inference
from rig.verbs.frames import Frame, of_columns
from rig.verbs.infer import CalibrationFile, CsvReader, read_calibration
from rig.verbs.observations import Columned
from rig.verbs.result import Plots

if TYPE_CHECKING:
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.tables.table import Reader
    from rig.tables.given import Columns

    Readings = str | Path | Columns
    """A CSV file, or columns by name."""


class Inferred(Columned):
    """Quantities inferred from readings, with standard deviations and 95 % intervals.

    Attributes:
        found: columns of the readings and the added ones, notes, flags.
        simulated: whether the calibration is from a simulated run.
        file: the written file; None if there is none.
    """

    def __init__(
        self,
        found: Inference,
        *,
        simulated: bool,
        file: Path | None,
        understood: Mapping[str, Any] | None = None,
    ) -> None:
        self.found = found
        self.understood = dict(understood or {})
        self.simulated = simulated
        self.file = file

    @property
    def columns(self) -> Mapping[str, np.ndarray[Any, Any]]:
        """(n,) values by column name: those of the readings, then the added ones."""
        return {name: np.asarray(values) for name, values in self.found.columns.items()}

    @property
    def _told(self) -> dict[str, Any]:
        """With "file" None where none was written."""
        file = None if self.file is None else str(self.file)
        told = {"file": file, "simulated": self.simulated, **self.found.to_json()}
        return {**told, "understood": self.understood} if self.understood else told

    @property
    def words(self) -> str:
        """Number of rows, number of flagged rows, and added columns."""
        added = f"{', '.join(self.found.quantities)} with _sd, _lo95, _hi95 and flag"
        counts = {str(one) for one in self.found.readings.values()}
        if len(counts) == 1 and (count := counts.pop()).isdigit():
            added += ", for a reading in use that is " + ("one" if count == "1" else f"the mean of {count}")
        return f"{len(self)} rows, {self.found.flagged} flagged; {added}"

    def blocks(self) -> Iterable[Block]:
        """A summary, and the first rows of the inferred quantities."""
        yield Line(f"{simulated_mark(self.simulated)}{escape(self.words)}")
        ends = ("", "_sd", "_lo95", "_hi95")
        errors = {f"{name}{end}": f"{name}_sd" for name in self.found.quantities for end in ends}
        yield from self._first_rows(self.found.added, errors)

    def notes(self) -> Sequence[str]:
        """Notes about the calibration and the readings, and unused columns."""
        first = (self.understood["sentence"],) if self.understood else ()
        return (*first, *once(self.found.notes), *sentences(self.found.unused.to_json()))

    def frame(self) -> Frame:
        """All columns."""
        return of_columns(self.columns, {"simulated": int(self.simulated)})

    def plot(self) -> Plots:
        """One figure: every quantity with its 95 % interval, row by row."""
        from rig.procedures.present.pictures import grid  # noqa: PLC0415 - matplotlib takes a second to import

        columns, row = self.columns, np.arange(len(self)) + 1
        figure, axes = grid(len(self.found.quantities), columns=1, height=2.6)
        for axis, name in zip(axes, self.found.quantities, strict=True):
            value, low, high = (np.asarray(columns[name + end], np.float64) for end in ("", "_lo95", "_hi95"))
            axis.vlines(row, low, high, color="0.6", lw=1.0, label="95 % interval")
            axis.plot(row, value, ".", ms=4, label=name)
            axis.set_title(name, fontsize=9)
            axis.set_xlabel("row", fontsize=8)
            axis.legend(fontsize=7, frameon=False)
        return Plots((figure,))

    def __repr__(self) -> str:
        return f"<rig.Inferred: {self.words}>"


def infer(
    calibration: str | Path,
    readings: Readings,
    *,
    out: str | Path | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
    header: int | None = None,
    same_meter: bool = False,
    mean_of: int | None = None,
    **options: Any,
) -> Inferred:
    """Infer the measured quantities of a calibration file.

    Args:
        calibration: file of `rig fit --out` or `Calibration.save`.
        readings: a CSV file, or columns by name, in which values may be missing.
        out: a CSV file to write; None for none.
        separator: of the CSV file; this and the next three as for `rig.open`.
        decimal: "point" or "comma".
        encoding: of its text.
        header: row of its column names; 0 for none.
        same_meter: whether the meter of the calibration's run reads the sensors, with the same errors.
        mean_of: number of readings of which each row is the mean; None for as many as a point of the run had.
        options: of `rig infer`, with underscores for hyphens.

    Raises:
        UsageError: a file cannot be used, or this calibration does not have an option.
        DataError: a column is missing, or a value cannot be used.

    Example:
        >>> rig.open("night.sqlite").fit().save("package.json")
        >>> rig.infer("package.json", {"x_V": [0.1, None], "y_V": [0.0, 0.0], "z_V": [-5.0, -5.0]})["flag"].tolist()[1]
        'no value of x_V'
    """
    path = Path(calibration)
    check_readings(readings, out, [path], options)
    asked = FileForm.of(separator, decimal, encoding, header)
    use: dict[str, Any] = {"same_meter": same_meter, "mean_of": mean_of}
    return infer_from(read_calibration(path), readings, out, options, asked, **use)


def infer_from(
    file: CalibrationFile,
    readings: Readings,
    out: str | Path | None,
    options: Mapping[str, Any],
    asked: FileForm = NOTHING,
    *,
    same_meter: bool = False,
    mean_of: int | None = None,
) -> Inferred:
    """Infer by a calibration that has been read; arguments and errors as for `infer`."""
    given = {name: value for name, value in options.items() if value is not None}
    chosen = options_of(file.kind, given, lambda kind: kind.infer_options, f"this calibration is of {file.kind.title}")
    reader = _reader(readings, asked)
    found = inference.infer(file, reader, chosen, same_meter=same_meter, mean_of=mean_of)
    understood = reader.understood if isinstance(reader, CsvReader) else {}
    if out is not None:
        write_csv(found.columns, Path(out))
    written = None if out is None else Path(out)
    return Inferred(found, simulated=file.simulated, file=written, understood=understood)


def check_readings(
    readings: Readings, out: str | Path | None, read: Sequence[Path], options: Mapping[str, Any]
) -> None:
    """Refuse to overwrite an input. Raises `UsageError`."""
    files = [readings] if isinstance(readings, (str, Path)) else []
    named = [value for value in options.values() if isinstance(value, Path)]
    check_files([None if out is None else Path(out)], [*read, *map(Path, files), *named])
    check_format(None if out is None else Path(out), ".csv")


def _reader(readings: Readings, asked: FileForm) -> Reader:
    if isinstance(readings, (str, Path)):
        return CsvReader(Path(readings), asked)
    table = table_given(readings)
    return lambda needed: table
