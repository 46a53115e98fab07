"""A CSV table in place of a run file: its observations, and a bench of what is stated to read and set its columns."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.bench.config import ROOM, BenchConfig, InstrumentConfig, SensorConfig, TemperatureConfig
from rig.errors import ConfigurationError, UsageError
from rig.files.regular import open_regular
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.procedures.column_names import split_unit
from rig.procedures.errors import DataError
from rig.procedures.tables.table import Table
from rig.register import DOCUMENT, Register, read_register
from rig.tables import FileSource
from rig.verbs.budget.evaluation import Checked, checked_with

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome

_KIND = "general"
_NOT_STATED = "instrument not stated"
_TEMPERATURE = "degC"


@dataclass(frozen=True)
class Said:
    """Contents of a run file that somebody states.

    Attributes:
        began: first day of the measurement.
        ended: its last day.
        models: formula of each output, by its column.
        given_by: equipment that reads or sets each column, by its key in the register.
        where: name of the file that says it, for messages.
        room: columns that recorded the room in which the equipment stands.
    """

    began: date
    ended: date
    models: Mapping[str, str]
    given_by: Mapping[str, str]
    where: str
    room: tuple[str, ...] = ()


@dataclass(frozen=True)
class OfTable:
    """A table that is read as a run. See `rig.procedures.evaluate.results.Source`."""

    table: Table
    is_run: bool = True

    @property
    def name(self) -> str:
        """Its file."""
        return self.table.source

    def read(self, needed: Collection[str]) -> Table:
        """The table. Raises `DataError` if it lacks a column."""
        for name in needed:
            if name not in self.table.columns:
                raise DataError(f"{self.name} has no column {name}")
        return self.table

    def all_columns(self) -> Table:
        """The table."""
        return self.table


def checked_table(path: Path, said: Said, equipment: Path | None, folder: Path) -> Checked:
    """A table with its register, and all reasons against a budget at once.

    Args:
        path: the CSV file.
        said: about it.
        equipment: the register; None for equipment.toml of `folder`.
        folder: of the file that says the rest.

    Raises:
        UsageError: a column is missing, or its name has no unit.
        ConfigurationError: the register cannot be read.
        DataError: a model cannot be read.
    """
    table = _table(path, said)
    reasons: list[str] = []
    given = equipment or folder / DOCUMENT
    register: Register | None = None
    if given.exists() or equipment is not None:
        register = read_register(given)
        known = {name: one for name, one in said.given_by.items() if one in register.equipment}
        reasons += [
            f"{given}: equipment.{one} is missing, and table.given_by.{name} of {said.where} names it: add it, or "
            "correct the name"
            for name, one in said.given_by.items()
            if name not in known
        ]
        said = replace(said, given_by=known)
    else:
        reasons.append(f"{path} has no register of equipment: name one with --equipment FILE (docs/how_to/register.md)")
    return checked_with(table, _bench(table, said), register, (), str(given), reasons)


def _table(path: Path, said: Said) -> Table:
    """The observations, as a table of a run has them."""
    factors: dict[str, None] = {}
    for output, formula in said.models.items():
        try:
            factors |= dict.fromkeys(Formula.parse(formula).names)
        except FitError as error:
            raise DataError(f"{said.where}: table.models.{output}: {error}") from error
    needed = (*said.models, *factors)
    table = FileSource(path).read([*needed, *said.given_by, *said.room])
    for name in (*needed, *said.given_by, *said.room):
        if name not in table.columns:
            raise UsageError(f"{path}: column {name} is no column of numbers")
    for name in (*needed, *said.given_by, *said.room):
        if not all(split_unit(name)) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            raise UsageError(
                f"{path}: column {name!r} has no unit in its name: rename it as NAME_UNIT, such as force_kN, so that "
                "the register can say what its errors are"
            )
    with open_regular(path) as file:
        head = hashlib.sha256(file.read()).hexdigest()
    simulated = bool(np.any(table.columns.get("simulated", np.zeros(1))))
    provenance: dict[str, Any] = {
        "file": path.name,
        "head": head,
        "simulated": simulated,
        "points_observed": len(table),
        "began_utc": said.began.isoformat(),
        "last_observation_utc": said.ended.isoformat(),
    }
    return replace(
        table,
        simulated=simulated,
        provenance=provenance,
        declared={
            "formula": next(iter(said.models.values())),
            **{split_unit(output)[0]: {"formula": formula} for output, formula in said.models.items()},
        },
        kind=_KIND,
        outputs={output: split_unit(output)[0] for output in said.models},
        factors=tuple(factors),
    )


def _bench(table: Table, said: Said) -> BenchConfig:
    """A bench on which each stated piece of equipment is an instrument."""
    names = {asset: re.sub(r"\W+", "_", asset) for asset in said.given_by.values()}
    instruments = {name: InstrumentConfig(driver="person", asset=asset) for asset, name in names.items()}

    def reader(column: str) -> str:
        if column in said.given_by:
            return names[said.given_by[column]]
        instruments[_NOT_STATED] = InstrumentConfig(driver="person")
        return _NOT_STATED

    sensors = {
        name: SensorConfig(unit=split_unit(output)[1], reader=reader(output), channel=output)
        for output, name in table.outputs.items()
    }
    recorded = [name for name in table.columns if name not in (*table.outputs, *table.factors)]
    temperatures = {
        name: TemperatureConfig(reader=reader(name), channel=name, place=ROOM if name in said.room else "package")
        for name in recorded
        if name in said.room or (split_unit(name)[1] == _TEMPERATURE and np.isfinite(table.columns[name]).all())
    }
    factors = {name: reader(name) for name in table.factors}
    try:
        return BenchConfig(
            name=Path(table.source).stem, instruments=instruments, sensors=sensors, temperatures=temperatures,
            factors=factors,
        )  # fmt: skip
    except ValueError as error:
        raise ConfigurationError(f"{said.where}: [table] cannot be used: {error}") from error


def lacks(table: Table, config: BenchConfig, register: str) -> Iterator[str]:
    """Sentences on all that is not known because there is no run file."""
    p = table.provenance
    yield (
        f"There is no run file: the record of this calibration is the table {p['file']} with {len(table)} rows. "
        f"Its SHA-256 is {p['head']}. Nothing shows that no row was changed or left out before."
    )
    yield (
        "No instrument reported its identity, its settings or its state: the equipment is the one that "
        f"{register} names for the columns of the table, and the laboratory states the days of the measurement."
    )
    if not config.temperatures:
        yield "No environment was recorded: the table has no column of a temperature beside the model."
    unknown = [words for name, words in _HISTORY.items() if name not in table.columns]
    yield (
        "No history was recorded: skipped, repeated and rejected readings, interruptions, and steps by hand are not "
        f"known{', nor are ' * bool(unknown)}{' and '.join(unknown)}."
    )
    if sentence := table.understood.get("sentence"):
        yield f"{sentence}."
    if table.gaps:
        yield f"Columns with missing values were not used: {', '.join(table.gaps)}."


def gross_errors(
    fitted: Mapping[str, Any], outcomes: Iterable[Outcome], keep: Collection[int], where: str
) -> Iterator[tuple[bool, str]]:
    """Rows that the search for gross errors names: whether all of an output are to be kept, and a sentence.

    None of an output beside whose model the trace finds effects: those rows may show them.

    Args:
        fitted: JSON of the fit.
        outcomes: of the trace.
        keep: rows that the laboratory keeps.
        where: name of the file that says so, for messages.
    """
    explained = {one.sensor for one in outcomes if any(found.kind == "effect" for found in one.named)}
    sensors: Mapping[str, Any] = fitted.get("sensors") or {fitted["response"]: fitted}
    for output, each in sensors.items():
        found = each["gross_errors"]
        if output in explained or not found["rows"]:
            continue
        listed = "; ".join(
            f"row {row} is {off:.3g} sd off" for row, off in zip(found["rows"], found["distance_sd"], strict=True)
        )
        if set(found["rows"]) <= set(keep):
            yield True, f"Gross errors of {output} stay in the results: {listed}."
        else:
            yield (
                False,
                (
                    f"{output}: gross errors, {listed}: look in the log; take these rows out of the table and say so "
                    f"in remarks, or name them in table.keep of {where}"
                ),
            )


def without_size(outcomes: Iterable[Outcome], table: Table, where: str) -> Iterator[str]:
    """Effects that cannot be counted in the results, one reason each: without times, or with a doubtful name."""
    for outcome in outcomes:
        for one in outcome.named:
            if one.doubtful:
                yield (
                    f"{outcome.sensor}: the name of effect {one.effect} is doubtful: {one.doubtful}; no further run "
                    f"confirms it, because a table is none: state in table.models of {where} what is known, or make a "
                    "run of rig"
                )
            elif one.kind == "effect" and "elapsed_s" not in table.columns:
                yield (
                    f"{outcome.sensor}: beside the declared model the trace finds {one.effect}, and the table has no "
                    f"times (a column elapsed_s) to count it in the results: add its term to table.models of {where}; "
                    "rig trace shows it"
                )


_HISTORY = {"elapsed_s": "times (elapsed_s)", "replicate": "replications (replicate)"}
"""Columns of a run's history that a table may have, too."""
