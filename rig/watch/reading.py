"""Reading run files for the page: new records by number, and a few complete observations, in short transactions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rig.procedures.plan.run_list import Factor
from rig.run_file.bodies import NUMBER, ContentsError
from rig.run_file.chain import Record
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader

BATCH = 20_000
"""Records per read: a long run is read in many short transactions."""

_ASKED = 500


@dataclass(frozen=True)
class ShownObservation:
    """The parts of an accepted observation that the page shows.

    Attributes:
        seq: number of its record.
        elapsed_s: bench seconds since the run was created.
        utc_s: seconds since 1970-01-01.
        index: index of its point.
        whole_plot: its whole plot, if any.
        setpoints: by factor name.
        outputs: by column name: mean, standard deviation of one reading, number of readings.
        temperatures: likewise.
        references: likewise.
        environment: temperature of every chamber, degrees Celsius.
        flags: as recorded.
    """

    seq: int
    elapsed_s: float
    utc_s: float
    index: int
    whole_plot: int | None
    setpoints: Mapping[str, float]
    outputs: Mapping[str, tuple[float, float, int]]
    temperatures: Mapping[str, tuple[float, float, int]]
    references: Mapping[str, tuple[float, float, int]]
    environment: Mapping[str, float]
    flags: Sequence[str]

    def mean(self, name: str) -> float | None:
        """Value of a factor: measured if there is a measurement, otherwise its setpoint."""
        for group in (self.references, self.temperatures):
            if name in group:
                return group[name][0]
        return self.setpoints.get(name)


class WatchReader(RunReader):
    """A run file opened read-only for one update. Raises `RunFileError` if it cannot be read."""

    def since(self, seq: int) -> list[tuple[int, Record]]:
        """The next records after `seq`, at most `BATCH`, without the bodies of observations."""
        rows = self._all(
            "SELECT seq, session, kind, elapsed_s, utc_s, run_index, whole_plot, attempt, status, "
            "CASE kind WHEN 'observation' THEN '{}' ELSE body END FROM record WHERE seq > ? ORDER BY seq LIMIT ?",
            (seq, BATCH),
        )
        return [(row[0], self.sensible(row)) for row in rows]

    def observations(self, seqs: Iterable[int], factors: Sequence[Factor]) -> list[ShownObservation]:
        """Observations by the numbers of their records; one whose contents make no sense is left out."""
        wanted, found = sorted(set(seqs)), []
        for first in range(0, len(wanted), _ASKED):
            some = tuple(wanted[first : first + _ASKED])
            marks = ", ".join("?" * len(some))
            names = "".join(f', point."{f.name}"' for f in factors)
            rows = self._all(
                "SELECT seq, session, kind, elapsed_s, utc_s, record.run_index, record.whole_plot, attempt, status, "
                f"body{names} FROM record "
                f"JOIN point ON point.run_index = record.run_index WHERE seq IN ({marks}) ORDER BY seq",
                some,
            )
            for row in rows:
                seen = _seen(row[10:], self.sensible(row), factors)
                found += [] if seen is None else [seen]
        return found

    def accepted(self) -> int:
        """Number of points with an accepted observation; the index of accepted observations is sufficient for it."""
        return int(
            self._all(
                "SELECT count(DISTINCT run_index) FROM record WHERE kind = 'observation' AND status = 'accepted'"
            )[0][0]
        )

    def ended(self) -> str:
        """Status of the run's end, "" if it has not ended."""
        for (status,) in self._all("SELECT status FROM record WHERE kind = 'end' ORDER BY seq DESC LIMIT 1"):
            return str(status)
        return ""

    def planned_whole_plots(self) -> int:
        """Number of whole plots of the run list; 0 if no factor is hard to change."""
        return int(self._all("SELECT count(DISTINCT whole_plot) FROM point")[0][0])


def _seen(row: Sequence[Any], record: Record, factors: Sequence[Factor]) -> ShownObservation | None:
    if not all(map(NUMBER.holds, row)):
        return None
    try:
        seen = record.event
        if not (isinstance(seen, Observed) and seen.outputs):
            return None
        return ShownObservation(
            seq=record.seq,
            elapsed_s=record.elapsed_s,
            utc_s=record.utc_s,
            index=record.run_index or 0,
            whole_plot=record.whole_plot,
            setpoints={f.name: float(v) for f, v in zip(factors, row, strict=True)},
            outputs=_channels(seen.outputs),
            temperatures=_channels(seen.temperatures),
            references=_channels(seen.references),
            environment={n: float(c["temperature_degC"]) for n, c in seen.environment.items()},
            flags=list(seen.flags),
        )
    except ContentsError:
        return None  # not written by a controller; `rig verify` says more


def _channels(group: Mapping[str, Any]) -> dict[str, tuple[float, float, int]]:
    return {n: (float(c["mean"]), float(c["sd"]), len(c["readings"])) for n, c in group.items()}
