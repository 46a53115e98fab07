"""The observations of a run file as a table.

Its columns are in the order: replicate, whole_plot, order, elapsed_s; factors; their setpoints; all others; outputs.
"""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RunFileError
from rig.procedures.column_names import moves_of, since_of, split_unit, with_word
from rig.procedures.plan.hand_steps import Made
from rig.procedures.plan.run_list import RunList
from rig.procedures.present.shell import shell_word
from rig.procedures.tables.table import CORRECTED, SENSOR_TEMPERATURE, Columns, Table
from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record
from rig.run_file.events.bench import Warned
from rig.run_file.events.by_hand import DoneByHand, SetByHand
from rig.run_file.events.corrections import Corrected
from rig.run_file.events.points import DOUBTED, Observed, Skipped, WholePlotLost
from rig.run_file.events.sessions import Ended
from rig.run_file.read.reader import RunReader
from rig.run_file.state.corrected import Corrections
from rig.run_file.state.documents import Stored, declared_model, kind_of_run, mounting_of
from rig.run_file.state.state import read_state
from rig.run_file.verify.verification import LOOP
from rig.tables.behind_rows import evidence_of, fill_flags, moving_inside, within_points
from rig.tables.own_times import keep_those_that_differ, own_times, typed_in
from rig.tables.provenance import instruments_of, operators_of, standards_of
from rig.tables.set_in import put_in_place, setters_of

_MOUNTING = ("mounting_x_deg", "mounting_y_deg", "mounting_z_deg")
"""Columns for the orientation of a turned package: about x, then y, then z."""


def run_table(path: Path, *, everything: bool = False, salvage: bool = False, evidence: bool = False) -> Table:
    """Observations of a run file, in the order they were made.

    Args:
        path: the run file.
        everything: include rejected and doubtful observations (missing values are NaN), with a column `accepted`.
        salvage: use readable parts of a file that fails verification.
        evidence: add columns with the scatter and number of readings, and flags (`rig.tables.behind_rows`).

    Raises:
        RunFileError: the file was damaged or edited (unless salvaged), or holds no observations.
    """
    with RunReader.open(path) as reader:
        if not salvage:
            reader.verify()
        began, run = reader.genesis().utc_s, reader.about()
        run_list, documents = reader.run_list(), reader.documents()
        bench = Stored.of(documents, "bench.toml")
        factors = setters_of(bench)
        turned = {f"mounting_{axis}": turn for axis, turn in mounting_of(documents).items()}
        made, settings, typed = ((), [], {}) if salvage else (_by_hand(reader), _set_by_hand(reader), typed_in(reader))
        rows: list[dict[str, float]] = []
        left_out, rejected, flags, used = 0, 0, Counter[str](), list[tuple[Observed, Mapping[str, float]]]()
        doubted = _doubted(reader.salvage() if salvage else reader.records(WholePlotLost.kind))
        marks = partial(_mark, told_later={} if salvage else _told_later(reader), evidence=evidence)
        corrections = Corrections(reader.salvage() if salvage else reader.records(Corrected.kind), run_list)
        records = reader.salvage() if salvage else reader.records(Observed.kind)
        for record in records:
            try:
                if record.kind != Observed.kind:
                    continue
                accepted = record.accepted and record.elapsed_s < doubted.get(record.whole_plot, math.inf)
                left_out += record.accepted and not accepted
                rejected += not record.accepted and not everything
                if not (accepted or everything):
                    continue
                seen = corrections.seen(record)
                row = _row(record, seen, run_list, len(rows) + 1, factors) | (
                    own_times(record, seen, typed) if factors else {}
                )
                flags.update(marks(row, record, seen))
                row["block"] += sum(one.elapsed_s <= record.elapsed_s for one in made)
            except ContentsError:
                if not salvage:
                    raise
                continue
            if everything:
                row["accepted"] = float(accepted)
            if any(turned.values()):
                row |= dict.fromkeys(_MOUNTING, 0.0) | turned
            row |= {"simulated": 1.0} if run.simulated else {}
            rows.append(row)
            used += [(seen, _steps(record, seen, run_list))] if accepted else []
        instruments, operators = ({}, []) if salvage else (instruments_of(reader, documents), operators_of(reader))
        last = began if salvage else max((r.utc_s for r in reader.records(Observed.kind)), default=began)
        head, ended = reader.head()[1], not salvage and any(True for _ in reader.records(Ended.kind))
        skipped = [] if salvage else _skipped(reader, run_list)
    if not rows:
        raise _without_rows(path, documents)
    set_in = _fill(rows, run_list, made, bench, settings)
    columns = {name: np.array([row.get(name, math.nan) for row in rows], float) for name in _all_names(rows)}
    provenance = {
        "file": path.name,
        "run_id": run.run_id,
        "simulated": run.simulated,
        "head": head.hex(),
        "bench": run.bench or "",
        "procedure": run.procedure or "",
        "software": dict(run.software),
        **({"operator": ", ".join(operators)} if operators else {}),
        "began_utc": _utc(began),
        "last_observation_utc": _utc(last),
        "instruments": instruments,
        **(
            {"reference standards": standards}
            if (standards := standards_of(bench, {} if salvage else documents))
            else {}
        ),
        "complete": ended,
        "points_planned": len(run_list),
        "points_observed": len(rows),
        **({"by_hand": [one.as_json() for one in made]} if made else {}),
        **({"skipped": skipped} if skipped else {}),
        **({"left_out_in_doubt": left_out} if left_out else {}),
        **({"flags": dict(flags)} if flags else {}),
        **({"observations_rejected": rejected} if rejected else {}),
        **({CORRECTED: corrections.told} if corrections.told else {}),
    }
    about = Table(str(path), _package_temperature(columns, bench), run.simulated, provenance)
    about = replace(about, within=within_points([seen for seen, _ in used]), moving=moving_inside(used))
    return replace(
        _of_sensors(about, bench, run_list, set_in),
        declared=declared_model(documents),
        kind=kind_of_run(documents),
        by_hand=made,
    )


def _without_rows(path: Path, documents: Mapping[str, str]) -> RunFileError:
    if LOOP in documents:
        return RunFileError(
            f"{path} is the program file of a loop, without observations of its own: name one of its runs"
        )
    return RunFileError(f"{path} holds no observations yet; `rig resume {shell_word(path)}` measures some")


def _of_sensors(table: Table, bench: Stored, run_list: RunList, set_in: Mapping[str, str]) -> Table:
    """The table with what the bench file says of the sensors, and with the names of the factors; columns in order."""
    sensors = {f"{name}_{s.text('unit', 'V')}": (name, s) for name, s in bench.table("sensors").tables()}
    axes = {column: s.text("axis") for column, (_, s) in sensors.items() if "axis" in s}
    outputs = {column: name for column, (name, _) in sensors.items() if column in table.columns}
    read = {setting: name for name, setting in set_in.items()}
    factors = tuple(read.get(factor.set_name, factor.name) for factor in run_list.factors)
    settings = (*(with_word(name, "set") for name in set_in), *(one.set_name for one in run_list.factors))
    first = ("replicate", "whole_plot", "order", "elapsed_s", *factors, *settings)
    others = (name for name in table.columns if name not in outputs)
    names = dict.fromkeys((*(name for name in first if name in table.columns), *others, *outputs))
    columns = {name: table.columns[name] for name in names}
    standards = dict(bench.table("references").tables())
    readers = {
        column: one.text("reader") for column, one in [*((c, s) for c, (_, s) in sensors.items()), *standards.items()]
    }
    sources = {name: str(source) for name, source in bench.table("factors").everything().items()}
    sources |= {name: sources[of] for name, one in standards.items() if (of := one.text("of")) in sources}
    table = replace(table, readers=readers, sources=sources)
    return replace(table, columns=columns, axes=axes, outputs=outputs, factors=factors, set_in=set_in)


def _mark(
    row: dict[str, float], record: Record, seen: Observed, told_later: Mapping[int | None, float], *, evidence: bool
) -> Sequence[str]:
    """Flags of an observation, also those told later; with `evidence` its columns are added to the row."""
    told_s = told_later.get(record.run_index, -math.inf)
    flags = [*seen.flags, DOUBTED] if record.accepted and record.elapsed_s <= told_s else seen.flags
    if evidence:
        row |= evidence_of(seen, flags)
    return flags


def _told_later(reader: RunReader) -> dict[int | None, float]:
    """Elapsed time at which the last observation of a point was doubted, by its index."""
    events = ((record, record.event) for record in reader.records(Warned.kind))
    return {e.doubted: r.elapsed_s for r, e in events if isinstance(e, Warned) and e.doubted is not None}


def _package_temperature(columns: Columns, bench: Stored) -> Columns:
    """The table with the package's temperature under its standard name; a bench may use another name."""
    if SENSOR_TEMPERATURE in columns:
        return columns
    for name, entry in bench.table("temperatures").tables():
        if entry.text("place", "package") == "package" and name in columns:
            return {SENSOR_TEMPERATURE: columns[name], **columns}
    return columns


def _by_hand(reader: RunReader) -> tuple[Made, ...]:
    """Changes that a person made, in order."""
    found = ((record, record.event) for record in reader.records(DoneByHand.kind))
    return tuple(
        Made(done.change, done.say, record.elapsed_s, done.value, done.number, done.who)
        for record, done in found
        if isinstance(done, DoneByHand)
    )


def _set_by_hand(reader: RunReader) -> list[tuple[float, str]]:
    """Elapsed time of every setting that a person made, and its factor, in order."""
    found = ((record.elapsed_s, record.event) for record in reader.records(SetByHand.kind))
    return [(elapsed_s, event.factor) for elapsed_s, event in found if isinstance(event, SetByHand)]


def _fill_since(rows: Sequence[dict[str, float]], settings: Sequence[tuple[float, str]]) -> None:
    """Give every row the seconds since a person set a factor, if it was set before the first row."""
    for factor in dict.fromkeys(factor for _, factor in settings):
        name, times = since_of(factor), [elapsed_s for elapsed_s, one in settings if one == factor]
        if times[0] > min(row["elapsed_s"] for row in rows) or any(name in row for row in rows):
            continue
        for row in rows:
            row[name] = round(row["elapsed_s"] - max(t for t in times if t <= row["elapsed_s"]), 3)


def _fill_stated(rows: Sequence[dict[str, float]], made: Sequence[Made], bench: Stored) -> None:
    """Give every row the numbers that a person stated at steps by hand before it.

    They are columns where they were stated before the first row. One in the unit of a sensor is none: there it would
    be an output.
    """
    outputs = {s.text("unit", "V") for _, s in bench.table("sensors").tables()}
    numbers = [(one.elapsed_s, one.value, one.number) for one in made if one.number is not None]
    said = [one for one in numbers if split_unit(one[1])[1] not in outputs]
    for name in {value for since, value, _ in said if since <= rows[0]["elapsed_s"]}:
        for row in rows:
            known = [number for since, value, number in said if value == name and since <= row["elapsed_s"]]
            row.setdefault(name, known[-1])


def _doubted(records: Iterable[Record]) -> dict[int | None, float]:
    """Elapsed time from which accepted observations of a lost whole plot are in doubt, by its identity."""
    found: dict[int | None, float] = {}
    for record in records:
        with contextlib.suppress(ContentsError):  # a damaged record has no information
            lost = None if record.kind == Observed.kind else record.event
            since = lost.doubted_s if isinstance(lost, WholePlotLost) else None
            if since is not None and 0 <= since <= record.elapsed_s:
                found[record.whole_plot] = since
    return found


def _skipped(reader: RunReader, run_list: RunList) -> list[dict[str, Any]]:
    """Finally skipped points: index, settings, reason."""
    skips = (record.event for record in reader.records(Skipped.kind))
    if not any(isinstance(event, Skipped) and event.final for event in skips):
        return []
    found = []
    for index, reason in sorted(read_state(reader).skipped.items()):
        point = run_list.points[index]
        where = run_list.told(point)
        about = {"replication": point.replication, "whole_plot": point.whole_plot}
        found.append({"point": index, "where": where, **about, "reason": reason})
    return found


def _utc(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="minutes")


def _row(record: Record, seen: Observed, run_list: RunList, order: int, factors: Mapping[str, str]) -> dict[str, float]:
    """One observation as a row: place, time, approach, readings.

    A measured factor has a column with its value, and one with its setpoint (`Factor.set_name`).

    Args:
        record: the observation.
        seen: its event, with corrected values.
        run_list: has its point.
        order: executed position, from 1.
        factors: instrument of each factor.
    """
    point = run_list.points[int(record.run_index or 0)]
    row: dict[str, float] = {} if record.whole_plot is None else {"whole_plot": record.whole_plot}
    row |= {"replicate": point.replication, "order": order, "elapsed_s": _moment(record, seen)}
    measured = _means(seen.references) | _means(seen.temperatures)
    setpoints: dict[str, float] = {}
    for factor, value in run_list.setting(point).items():
        chamber = seen.environment.get(factors.get(factor, ""))
        if factor not in measured and chamber is not None:
            measured[factor] = chamber["temperature_degC"]
        row[factor] = measured.get(factor, value)
        if factor in measured:
            setpoints[run_list.factor(factor).set_name] = value
    row |= measured | _means(seen.outputs) | setpoints
    row |= {with_word(one["of"], "set"): one["tries"][-1][0] for one in seen.steered.values()}
    row |= {
        f"{f.axis}_side": side or _arrived(seen, f.axis)
        for f, side in zip(run_list.factors, point.sides, strict=True)
        if f in run_list.sided
    }
    by_hand = {f.name for f in run_list.easy if f.axis not in seen.settling}  # their readback is what was asked for
    readback = {name: value for name, value in seen.readback.items() if name not in measured and name not in by_hand}
    row |= {_readback_name(name): float(value) for name, value in readback.items()}
    for f in run_list.easy:
        since, start = moves_of(f.name)
        if f.axis in seen.moved:
            stepped_s, before = seen.moved[f.axis]
            row[start] = before
            if f.name in factors:  # kinds with factors of their own have no use for it
                row[since] = round(max(row["elapsed_s"] - stepped_s, 0.0), 3)
    return row | {"block": record.session, "run_index": point.index}


def _steps(record: Record, seen: Observed, run_list: RunList) -> dict[str, float]:
    """How far each easy factor was changed before an observation, as far as it is recorded."""
    setting = run_list.setting(run_list.points[int(record.run_index or 0)])
    return {f.name: setting[f.name] - seen.moved[f.axis][1] for f in run_list.easy if f.axis in seen.moved}


def _fill(
    rows: Sequence[dict[str, float]],
    run_list: RunList,
    made: Sequence[Made],
    bench: Stored,
    settings: Sequence[tuple[float, str]],
) -> Mapping[str, str]:
    """Give every row the setpoint of a factor that was measured in some of them, and what a person did before it.

    Returns `Table.set_in`.
    """
    for factor in run_list.factors:
        if any(factor.set_name in row for row in rows):
            for row in rows:
                if factor.set_name not in row and "run_index" in row:
                    row[factor.set_name] = run_list.setting(run_list.points[int(row["run_index"])])[factor.name]
    keep_those_that_differ(rows)
    _fill_stated(rows, made, bench)
    _fill_since(rows, settings)
    fill_flags(rows)
    return put_in_place(rows, run_list, bench)


def _arrived(seen: Observed, axis: str) -> int:
    """Side of approach as it was recorded; 0 if it is not known, as of a setting that was tried several times."""
    tried = any(split_unit(name)[0] == axis and len(one["tries"]) > 1 for name, one in seen.steered.items())
    return 0 if tried or axis not in seen.approach else int(seen.approach[axis][0])


def _readback_name(quantity: str) -> str:
    return with_word(quantity, "readback")


def _moment(record: Record, seen: Observed) -> float:
    began, ended = seen.measured_s or (record.elapsed_s, record.elapsed_s)
    return float(round((began + ended) / 2, 3))


def _means(group: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    return {name: float(channel["mean"]) for name, channel in group.items()}


def _all_names(rows: Iterable[Mapping[str, float]]) -> list[str]:
    """Column names in order of first appearance."""
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row)
    return list(names)
