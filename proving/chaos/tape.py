"""What the chaos checker reads: the tape of a bench and a run file. Shares no code with the project."""

from __future__ import annotations

import json
import math
import sqlite3
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Server:
    """One process that served the bench: bench clock = `zero` + world time."""

    zero: float
    speed: float
    epoch: float


@dataclass
class Reading:
    """A number on the tape; times by the bench clock."""

    begin: float
    end: float
    value: float
    line: dict[str, Any]


class Tape:
    """A tape, sorted. Times are those of the bench clock, which goes on when the server is started anew."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.servers: list[Server] = []
        self.readings: dict[tuple[str, str], list[Reading]] = defaultdict(list)
        self.readbacks: dict[str, list[Reading]] = defaultdict(list)
        self.changes: list[tuple[float, dict[str, Any]]] = []
        self.answers: dict[str, list[tuple[float, str]]] = defaultdict(list)
        self.asked: list[float] = []
        self.asked_of: dict[str, list[float]] = defaultdict(list)
        self.stalls: list[tuple[float, float]] = []
        for line in lines:
            self._add(line)
        self.asked.sort()
        self.changes.sort(key=lambda change: change[0])

    def _add(self, text: str) -> None:
        try:
            line = json.loads(text)
        except ValueError:
            return  # the server was killed in the middle of it
        if line["what"] == "server":
            self.servers.append(Server(line["boot_s"] * line["speed"] - line["t"], line["speed"], line["epoch_utc"]))
            return
        at = self.servers[-1].zero + line["t"]
        match line["what"]:
            case "asked":
                self.asked.append(at)
                for name in line["on"].split("+"):
                    self.asked_of[name].append(at)
            case "answered":
                self.answers[line["on"]].append((at, line["text"]))
            case "reading":
                end = self.servers[-1].zero + line["end_s"]
                self.readings[line["on"], line["channel"]].append(Reading(at, end, line["given"], line))
            case "readback":
                self.readbacks[line["on"]].append(Reading(at, at, line["given"], line))
            case "change":
                self.changes.append((at, line))
            case "stalled":
                self.stalls.append((at - line["seconds"], at))

    @property
    def speed(self) -> float:
        """Of the server that began last."""
        return self.servers[-1].speed

    def quiet(self, times: list[float], longer_than: float) -> Iterator[tuple[float, float]]:
        """Stretches between neighbours of `times` that are longer than so much."""
        for before, after in pairwise(times):
            if after - before > longer_than:
                yield before, after

    def stalled(self, begin: float, end: float) -> bool:
        """Whether the server itself had no turn somewhere in there, or another one took its place."""
        return any(a < end and b > begin for a, b in self.stalls) or any(begin < s.zero < end for s in self.servers[1:])


@dataclass
class Row:
    """A record."""

    seq: int
    session: int
    kind: str
    elapsed_s: float
    utc_s: float
    run_index: int | None
    whole_plot: int | None
    status: str | None
    body: dict[str, Any]


class Run:
    """A run file, as it stands."""

    def __init__(self, path: Path) -> None:
        db = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
        try:
            self.documents = {name: tomllib.loads(body) for name, body in db.execute("SELECT name, body FROM document")}
            factors = db.execute("SELECT name, axis, hard FROM factor ORDER BY position").fetchall()
            self.factors = [(str(name), str(axis), bool(hard)) for name, axis, hard in factors]
            n = len(factors)
            rows = db.execute("SELECT * FROM point ORDER BY run_index").fetchall()
            self.points = {r[0]: (r[2], r[3 : 3 + n], r[3 + n : 3 + 2 * n]) for r in rows}
            columns = "seq, session, kind, elapsed_s, utc_s, run_index, whole_plot, status, body"
            found = db.execute(f"SELECT {columns} FROM record ORDER BY seq").fetchall()
        finally:
            db.close()
        self.rows = [Row(*(*row[:-1], json.loads(row[-1]))) for row in found]
        self.bench, self.procedure = self.documents["bench.toml"], self.documents["procedure.toml"]
        self.accepted = [r for r in self.rows if (r.kind, r.status) == ("observation", "accepted")]
        self.sessions = {r.session: r for r in self.rows if r.kind == "session"}
        self.whole_plots = any(hard for _, _, hard in self.factors)

    def sources(self, row: Row) -> Iterator[tuple[str, tuple[str, str], float, list[float]]]:
        """Column, (instrument, channel), its unit in the tape's, readings."""
        for column, channel in row.body["outputs"].items():
            name, unit = column.rsplit("_", 1)
            sensor = self.bench["sensors"][name]
            scale = {"V": 1.0, "mV": 1e3}[unit]
            yield column, (sensor["reader"], str(sensor.get("channel", "input"))), scale, channel["readings"]
        for column, channel in row.body["temperatures"].items():
            source = self.bench["temperatures"][column]
            yield column, (source["reader"], str(source["channel"])), 1.0, channel["readings"]


def quantities(row: Row) -> Iterator[tuple[str, dict[str, Any]]]:
    """Quantities of an observation by column."""
    for group in ("outputs", "temperatures", "references"):
        yield from row.body.get(group, {}).items()


def accepted_in(path: Path) -> dict[tuple[int, int], str]:
    """Accepted observations of a run file: (point, whole plot or 0) to what was read."""
    return {(r.run_index or 0, r.whole_plot or 0): json.dumps(r.body) for r in Run(path).accepted}


def by_utc(server: Server, row: Row, elapsed_s: float) -> float:
    """The bench clock at a moment of a record's session, by the record's UTC."""
    return server.zero + row.utc_s + elapsed_s - row.elapsed_s - server.epoch


_STEPS = {"degC": 6e-5, "psi": 6e-8}
"""Half of the last digit that is said of a temperature (by the CAN unit) or a pressure."""


def same(reading: Reading, value: float, scale: float) -> bool:
    """Whether a value is that of a reading, to the last digit sent."""
    given = reading.value * scale
    tolerance = _STEPS.get(reading.line.get("unit", "psi"), 1e-9)
    return math.isfinite(given) and abs(given - value) <= tolerance + 2e-7 * abs(value)


def numbers(text: str) -> Iterator[float]:
    """Numbers in what an instrument said."""
    for word in text.replace(",", " ").replace(";", " ").split():
        try:
            yield float(word)
        except ValueError:
            continue


def found_among(
    tape: list[Reading], values: list[float], scale: float, begin: float, end: float
) -> list[Reading] | None:
    """Neighbours on the tape, within a time, that were given as `values`."""
    near = [r for r in tape if begin <= r.begin and r.end <= end]
    for at in range(len(near) - len(values) + 1):
        part = near[at : at + len(values)]
        if all(same(r, v, scale) for r, v in zip(part, values, strict=True)):
            return part
    return None
