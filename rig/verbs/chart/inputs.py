"""Input files of control charts: run files, calibration files and CSV tables, each with its date."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.files.regular import read_regular_text
from rig.procedures.errors import DataError
from rig.procedures.evaluate.charting import Calibrations, Charting
from rig.procedures.kind import Kind
from rig.procedures.kinds import kind_of_table, kinds
from rig.procedures.present.words import incomplete
from rig.procedures.tables.table import Table
from rig.procedures.tables.unused import Unused, sentences
from rig.run_file.bodies import TEXTS
from rig.tables import read_table
from rig.verbs.infer import read_calibration

_EARLIEST, _LATEST = 1900, 2200
"""Permitted years of calibrations; other dates are typing errors."""
_ALIKE_DEGC = 0.5
"""Maximum difference between mean temperatures of calibrations, degC: at 50 ppm per degC it is 25 ppm."""


@dataclass(frozen=True, eq=False)
class Given:
    """One calibration.

    Attributes:
        source: name of the file, as given.
        kind: kind of calibration.
        when: middle of the calibration, UTC.
        of: its sensors.
        unused: columns that are not used.
    """

    source: str
    kind: Kind
    when: datetime
    of: Calibrations
    unused: Unused = field(default_factory=Unused)

    @property
    def charting(self) -> Charting:
        """Charting functions of its kind."""
        return self.kind.charting()

    @property
    def sensors(self) -> Mapping[str, Any]:
        """By output column."""
        return self.of.sensors

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Provenance."""
        return self.of.provenance

    @property
    def date(self) -> str:
        """Date of the calibration, as 2026-01-15."""
        return f"{self.when:%Y-%m-%d}"


def read(source: str, formula: str | None = None) -> Given:
    """One calibration, from a run file, a calibration file or a CSV table.

    Raises:
        UsageError, RunFileError: the file is none of these, or has no date of measurement.
        DataError: columns or values are missing, or the data do not determine the model.
    """
    path, told = _path_and_date(source)
    if path.suffix == ".json":
        return _from_calibration_file(path, told)
    table = read_table(path)
    kind, found = _of_table(table, formula)
    return Given(str(path), kind, _when(path, found.provenance, told), found, kind.unused(table))


def _of_table(table: Table, formula: str | None) -> tuple[Kind, Calibrations]:
    kind = kind_of_table(table)
    if kind is not None:
        return kind, kind.charting().of_table(table, formula)
    kind = next(one for one in kinds().values() if one.asked_by)
    try:
        return kind, kind.charting().of_table(table, formula)
    except DataError as error:
        known = " or ".join(one.title for one in kinds().values() if not one.asked_by)
        raise UsageError(f"{table.source} is not a table of {known}. {error}") from error


def notes(given: Sequence[Given]) -> list[str]:
    """Changes between calibrations other than of the sensors, and missing parts: possible causes of a step."""
    found = _temperature_words(given)
    for one in given:
        missing = incomplete(one.provenance)
        if missing:
            found.append(f"the calibration of {one.date} is incomplete: {missing}")
        found.extend(f"{one.source}: {text}" for text in sentences(one.unused.to_json()))
    for before, after in pairwise(given):
        between = f"between {before.date} and {after.date}"
        changes = _changes(before.provenance, after.provenance)
        found.extend(f"{between} {what}: a step there may be due to that" for what in changes)
    degC = [one.of.degC for one in given if one.of.degC is not None]
    if degC and max(degC) - min(degC) > _ALIKE_DEGC and not all(one.of.corrected for one in given):
        found.append(
            f"the sensors' mean temperature was between {min(degC):.1f} and {max(degC):.1f} degC: a temperature "
            f"coefficient looks like a change over time"
        )
    return found


def _temperature_words(given: Sequence[Given]) -> list[str]:
    """Sensor temperature of the charted parameters."""
    known = [one.of.degC for one in given if one.of.degC is not None]
    if not given[0].charting.at_one_temperature:
        return []
    if all(one.of.corrected for one in given) and len(known) == len(given):
        return [f"parameters are charted at {np.mean(known):.2f} degC, and all calibrations were converted to it"]
    if not known:
        return ["the sensor temperature of the charted parameters was not recorded"]
    return ["charted parameters are for each calibration's own mean sensor temperature"]


def as_table(given: Sequence[Given], title: str) -> Table:
    """The calibrations as a table of their dates, with provenance, for the report."""
    days = np.array([one.when.timestamp() / 86400.0 for one in given])
    provenance = {f"{one.date}: {one.source}": _origin(one) for one in given}
    return Table(title, {"day": days - days[0]}, given[0].of.simulated, provenance)


def _origin(one: Given) -> str:
    p = one.provenance
    told = [f"{name} {p[name]}" for name in ("run_id", "bench", "procedure", "head") if p.get(name)]
    return "; ".join([*told, *(f"{name}: {words}" for name, words in (p.get("instruments") or {}).items())]) or "table"


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Changes of instrument, bench or procedure; a new certificate alone is not another instrument."""
    found = [
        f"the {name} changed from {before[name]} to {after[name]}"
        for name in ("bench", "procedure")
        if before.get(name) and after.get(name) and before[name] != after[name]
    ]
    old, new = before.get("instruments") or {}, after.get("instruments") or {}
    for name in (n for n in new if n in old):
        was, now = (_CALIBRATED.split(words)[0] for words in (old[name], new[name]))
        if was != now:
            found.append(f"the {name} changed from {was} to {now}")
    return found


_CALIBRATED = re.compile(r", (?:certificate [^,]*, )?calibration due")
"""Where the words about an instrument go on with its calibration."""
_TEXTS = ("run_id", "file", "bench", "procedure", "began_utc", "last_observation_utc", "head")
"""Words from the data of a calibration, if it has them."""


def _from_calibration_file(path: Path, told: datetime | None) -> Given:
    """A calibration file of `rig fit --out`."""
    kind = read_calibration(path).kind
    try:
        found = kind.charting().of_file(json.loads(read_regular_text(path)), str(path))
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise UsageError(f"{path}: {error}; give the run file instead") from error
    for name in _TEXTS:
        if not isinstance(found.provenance.get(name, ""), str):
            raise UsageError(f"{path} is not a calibration file of `rig fit --out`: its {name} is not a text")
    if not TEXTS.holds(found.provenance.get("instruments") or {}):
        raise UsageError(f"{path} is not a calibration file of `rig fit --out`: its instruments are not texts by name")
    return Given(str(path), kind, _when(path, found.provenance, told), found)


def path_of(source: str) -> Path:
    """The file of FILE@2026-01-15, or of FILE."""
    path = Path(source)
    return path if path.exists() or "@" not in source else Path(source.rpartition("@")[0])


def _path_and_date(source: str) -> tuple[Path, datetime | None]:
    path = path_of(source)
    if str(path) == str(Path(source)):
        return path, None
    date = source.rpartition("@")[2]
    told = _moment(date)
    if told is None:
        raise UsageError(f"{source}: {date!r} is not a date; write FILE@2026-01-15 or FILE@2026-01-15T18:00")
    return path, told


def _moment(text: object) -> datetime | None:
    """A time in UTC, which is assumed without a zone; None for anything else, or for implausible years."""
    try:
        moment = datetime.fromisoformat(str(text))
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):
        return None
    return moment if _EARLIEST <= moment.year <= _LATEST else None


def _when(path: Path, provenance: Mapping[str, Any], told: datetime | None) -> datetime:
    began = provenance.get("began_utc")
    if began is None:
        if told is None:
            raise UsageError(f"{path} has no date of measurement: write {path}@2026-01-15")
        return told
    if told is not None:
        raise UsageError(f"{path} contains its date of measurement, {began}: omit @ and the date")
    first, last = _moment(began), _moment(provenance.get("last_observation_utc", began))
    if first is None or last is None:
        raise UsageError(f"{path} has no date of measurement: {began!r} is not a date")
    return first + (last - first) / 2
