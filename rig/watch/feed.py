"""One run as shown by the page, updated by reading new records."""

from __future__ import annotations

import heapq
import json
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.errors import RigError
from rig.files.regular import real_path
from rig.procedures.column_names import spelled, split_unit
from rig.procedures.plan.expected import Previous
from rig.procedures.plan.run_list import Factor
from rig.procedures.present.as_json import finite
from rig.run_file.chain import Record
from rig.run_file.live import controller_alive, live_path, number, read_json, settling_now
from rig.run_file.state.documents import declared_model, kind_of_run, mounting_of
from rig.run_file.state.state import RunState
from rig.watch.lines import Lines
from rig.watch.reading import BATCH, ShownObservation, WatchReader
from rig.watch.residuals import residuals
from rig.watch.words import expected_end, state_now

KEPT = 500
"""Size of the sample; every observation has the same probability to be in it."""
RECENT = 100
"""Number of last observations that are always shown."""


class Sample:
    """Selects the observations shown by the page: `KEPT` of all and the last `RECENT`, by record number.

    The choice is by a hash of the record's number. So a restarted server shows the same points, and a design with a
    period does not meet a sample with the same period.
    """

    def __init__(self) -> None:
        self._heap: list[tuple[int, int]] = []
        self._recent: deque[int] = deque(maxlen=RECENT)

    def add(self, seq: int) -> None:
        """Take one more accepted observation."""
        self._recent.append(seq)
        item = (-_hash(seq), seq)  # the first of a heap is its smallest; here it must be the largest hash
        if len(self._heap) < KEPT:
            heapq.heappush(self._heap, item)
        elif item > self._heap[0]:
            heapq.heapreplace(self._heap, item)

    def seqs(self) -> set[int]:
        """Numbers of the chosen records."""
        return {seq for _, seq in self._heap}.union(self._recent)


def _hash(number: int) -> int:
    """Splitmix64: neighbouring numbers get very different hashes."""
    mask = (1 << 64) - 1
    z = (number + 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return z ^ (z >> 31)


_LEAST_S = 0.5
"""Minimum seconds between two reads of a run file, however many pages are open."""
_CHARTS_S = 4.0
"""Minimum seconds between two updates of charts."""
_TICK_S = 2.0
"""Resolution of a file's time of change, seconds: on some file systems two writes within it have the same time."""


@dataclass
class _Charts:
    """Charts of the whole run, and the number of records they show."""

    seq: int = 0
    made: float = -1e9
    version: int = 0
    content: dict[str, Any] | None = None


class RunFeed:
    """One run file, read as it grows. May be called from several threads.

    Args:
        path: the run file.
        reference: a previous calibration to compare observations with.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.

    Attributes:
        seq: number of the last record read.
    """

    def __init__(
        self, path: Path, reference: Previous | None, stopwatch: Callable[[], float], utc: Callable[[], float]
    ) -> None:
        self.path = path
        self.seq = 0
        self._reference, self._stopwatch, self._utc = reference, stopwatch, utc
        self._lock = threading.Lock()
        self._looked = -1e9
        self._print: tuple[object, ...] = ()
        self._state = RunState()
        self._lines = Lines()
        self._sample = Sample()
        self._factors: tuple[Factor, ...] = ()
        self._whole_plots = 0
        self._about: dict[str, Any] = {}
        self._kind = ""
        self._declared: Mapping[str, Any] = {}
        self._mounting: Mapping[str, float] = {}
        self._loaded: dict[int, ShownObservation] = {}
        self._last_seq = 0
        self._last: ShownObservation | None = None
        self._charts = _Charts()
        self._error = ""

    def check(self) -> None:
        """Check that there is a run file to show. Raises `UsageError` or `RunFileError`."""
        WatchReader.open(self.path).close()

    def refresh(self) -> None:
        """Read new records; an error is shown on the page, never raised."""
        with self._lock:
            now = self._stopwatch()
            if now - self._looked < _LEAST_S:
                return
            self._looked = now
            try:
                self._read()
                self._draw(now)
            except RigError as error:
                self._error = str(error)
            except OSError as error:
                self._error = f"{self.path.name} cannot be read: {error.strerror}"

    def view(self) -> dict[str, Any]:
        """All contents of the page, by section, as JSON values of bounded size."""
        with self._lock:
            live = read_json(live_path(self.path)) or {}
            running = bool(live) and controller_alive(self.path)
            news_s = None
            if running:
                try:
                    news_s = max(0.0, self._utc() - live_path(self.path).stat().st_mtime)
                except OSError:
                    news_s = None
            return {
                "about": self._about,
                "state": self._now(live if running else {}, running, news_s),
                "settling": settling_now(live, self._factors) if running else [],
                "readings": self._readings(),
                "warnings": [dict(one) for one in self._lines.warnings],
                "sessions": [dict(one) for one in self._lines.sessions],
                "whole_plots": [dict(one) for one in self._lines.whole_plots],
                "charts": self._charts.content,
            }

    def lines(self, after: int) -> dict[str, Any]:
        """The events after record `after`, in plain words, and the total number of lines."""
        with self._lock:
            return {"lines": self._lines.after(after), "told": self._lines.told, "seq": self.seq}

    # --- reading ----------------------------------------------------------------------------------------------

    def _read(self) -> None:
        seen, changed = _print(self.path)
        if seen == self._print:
            return
        if self._utc() - changed < _TICK_S:
            seen = ()  # more may be written without a change of the file's time or size
        while True:  # one transaction per batch; the writer is never blocked for long
            with WatchReader.open(self.path) as reader:
                if not self.seq:
                    self._begin(reader)
                batch = reader.since(self.seq)
                for seq, record in batch:
                    self._take(seq, record)
                if len(batch) == BATCH:
                    continue
                if self._last is None or self._last.seq != self._last_seq:
                    latest = reader.observations([self._last_seq], self._factors) if self._last_seq else []
                    self._last = latest[0] if latest else None
                break
        self._print, self._error = seen, ""

    def _begin(self, reader: WatchReader) -> None:
        genesis, documents = reader.genesis(), reader.documents()
        self._factors, self._whole_plots = reader.factors(), reader.planned_whole_plots()
        self._kind, self._declared = kind_of_run(documents), declared_model(documents)
        self._mounting = mounting_of(documents)
        run = reader.about()
        self._about = {
            "run_id": run.run_id,
            "file": self.path.name,
            "procedure": run.procedure or "",
            "bench": run.bench or "",
            "operator": run.operator or "",
            "simulated": run.simulated,
            "began_utc_s": genesis.utc_s,
            "against": self._reference.name if self._reference else None,
            "software": run.software.get("calibration-rig", ""),
        }

    def _take(self, seq: int, record: Record) -> None:
        self._state.add(record)
        self._lines.add(seq, record)
        if record.accepted:
            self._sample.add(seq)
            self._last_seq = seq
        self.seq = seq

    # # --- sections ---------------------------------------------------------------------------------------------

    def _now(self, live: Mapping[str, Any], running: bool, news_s: float | None) -> dict[str, Any]:
        fold = self._state
        done = len(fold.accepted) + len(fold.skipped)
        return {
            **state_now(fold, live, running, self.path),
            "running": running,
            "ended": fold.ended,
            "news_s": None if news_s is None else round(news_s, 1),
            "done": done,
            "accepted": len(fold.accepted),
            "skipped": len(fold.skipped),
            "points": fold.points,
            "elapsed_s": number(live.get("elapsed_s")) or fold.elapsed_s,
            "remaining_s": number(live.get("remaining_s")),
            "end_utc_s": expected_end(live),
            "last_record_utc_s": fold.utc_s or None,
            "whole_plot": fold.planned,
            "whole_plots": self._whole_plots,
            "faults": self._lines.faults,
            "last_fault": fold.last_fault,
            "error": self._error,
        }

    def _readings(self) -> dict[str, Any] | None:
        last = self._last
        if last is None:
            return None
        groups = (("output", last.outputs), ("temperature", last.temperatures), ("reference", last.references))
        rows = [
            {"kind": kind, "name": name, **said(name), "mean": mean, "sd": sd if n > 1 else None, "n": n}
            for kind, group in groups
            for name, (mean, sd, n) in group.items()
        ]
        rows += [
            {"kind": "chamber", "name": f"{name}_degC", **said(f"{name}_degC"), "mean": degC, "sd": None, "n": 1}
            for name, degC in last.environment.items()
        ]
        return {
            "index": last.index,
            "utc_s": last.utc_s,
            "setpoints": [{"name": name, **said(name), "value": value} for name, value in last.setpoints.items()],
            "flags": list(last.flags),
            "rows": rows,
        }

    def _draw(self, now: float) -> None:
        charts = self._charts
        if charts.content is not None and (charts.seq == self._last_seq or now - charts.made < _CHARTS_S):
            return
        chosen = self._sample.seqs()
        missing = chosen - self._loaded.keys()
        if missing:
            with WatchReader.open(self.path) as reader:
                self._loaded |= {s.seq: s for s in reader.observations(missing, self._factors)}
        self._loaded = {seq: self._loaded[seq] for seq in sorted(chosen) if seq in self._loaded}
        shown = list(self._loaded.values())
        charts.seq, charts.made, charts.version = self._last_seq, now, charts.version + 1
        charts.content = {
            "version": charts.version,
            "shown": len(shown),
            "observed": len(self._state.accepted),
            "residuals": self._residuals(shown),
            "temperatures": _temperatures(shown),
        }

    def _residuals(self, shown: list[ShownObservation]) -> dict[str, Any]:
        return residuals(shown, self._reference, self._kind, self._declared, self._mounting)


def said(name: str) -> dict[str, str]:
    """The words for a column and its unit, for people: only here, so that the page has no rule of its own for names."""
    stem, unit = split_unit(name)
    return {"what": stem.replace("_", " "), "unit": spelled(unit)} if stem else {"what": unit, "unit": ""}


def _temperatures(shown: list[ShownObservation]) -> dict[str, Any]:
    """Recorded temperatures and chambers over the run."""
    names = sorted({name for s in shown for name in s.temperatures if name.endswith("_degC")})
    chambers = sorted({name for s in shown for name in s.environment})
    series = {n: [s.temperatures[n][0] if n in s.temperatures else None for s in shown] for n in names}
    series |= {f"{n}_degC": [s.environment.get(n) for s in shown] for n in chambers}
    return {
        "elapsed_s": [round(s.elapsed_s, 1) for s in shown],
        "series": [
            {"name": n, **said(n), "values": [None if v is None else round(v, 4) for v in values]}
            for n, values in series.items()
        ],
    }


def _print(path: Path) -> tuple[tuple[object, ...], float]:
    """Values that change whenever a run file or its log does, and the time of the last change, seconds since
    1970-01-01.
    """
    found: list[object] = []
    changed = 0.0
    real = real_path(path)
    for one in (real, real.with_name(real.name + "-wal")):
        try:
            stat = one.stat()
            found.append((stat.st_ino, stat.st_size, stat.st_mtime_ns))
            changed = max(changed, stat.st_mtime)
        except OSError:
            found.append(None)
    return tuple(found), changed


def encoded(value: object) -> str:
    """JSON without NaN and infinity."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(finite(value), separators=(",", ":"), allow_nan=False)
