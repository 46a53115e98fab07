"""Ledgers: files that many programs append to, opened for a moment only; append-only and chained like a run file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from rig.drivers.clock import RealClock
from rig.errors import BusyError, RunFileError, UsageError
from rig.procedures.plan.run_list import RunList
from rig.run_file.chain import Record, encode
from rig.run_file.events.event import Event
from rig.run_file.last_word import head_path, read_last_word
from rig.run_file.read.reader import RunReader
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.version import VERSION
from rig.who import operator

_TRIES, _WAIT_S = 100, 0.1


class Folds(Protocol):
    """A state that records fold to."""

    def add(self, record: Record) -> None:
        """Take the next record."""


State = TypeVar("State", bound=Folds)


@dataclass(frozen=True)
class Ledger:
    """A ledger.

    Attributes:
        path: its file, made by the first event.
        mark: document that only files of its sort have.
        what: the sort, for messages: "queue".
    """

    path: Path
    mark: str
    what: str

    def append(self, state: State, decide: Callable[[State], Sequence[Event]]) -> State:
        """Write the events that `decide` returns for the present state, while nobody else writes.

        Args:
            state: an empty state, which takes all records.
            decide: an error that it raises leaves the file as it is.

        Returns:
            The state with the new events.

        Raises:
            BusyError: somebody else writes for more than ten seconds.
            RunFileError: the file was edited or damaged, or its last records were removed.
            StorageError: they could not be made durable.
        """
        clock = RealClock()
        if not self.path.exists():
            about = {"software": {"calibration-rig": VERSION}, **operator().as_json()}
            genesis = Genesis(self.path.stem, {self.mark: ""}, RunList((), (), 0), simulated=False, about=about)
            create(self.path, genesis, elapsed_s=0.0, utc_s=clock.utc())
        for left in range(_TRIES, 0, -1):
            try:
                with RunWriter.open(self.path) as writer:
                    return self._written(writer, state, decide, clock.utc())
            except BusyError:
                if left == 1:
                    raise
                clock.sleep(_WAIT_S)
        raise AssertionError

    def _written(
        self, writer: RunWriter, state: State, decide: Callable[[State], Sequence[Event]], utc_s: float
    ) -> State:
        self._check(writer)
        self._check_end(writer)
        first_s = writer.genesis().utc_s
        for record in writer.records():
            state.add(record)
        for event in decide(state):
            body = encode(event.body())
            record = Record(0, event.kind, max(0.0, utc_s - first_s), utc_s, status=event.status, body=body)
            writer.append(record, commit=False)
            state.add(record)
        writer.commit()
        return state

    def _check_end(self, writer: RunWriter) -> None:
        """Refuse to go on after missing records: the next commit would hide that they are missing."""
        last = read_last_word(self.path)
        if last is not None and not writer.holds(*last):
            head = head_path(self.path).name
            raise RunFileError(
                f"{self.path} has lost its last records, of {last[0]} that {head} beside it counts: nothing is added. "
                f"Put both files back from a backup; or move both away and keep them, and a new {self.what} begins"
            )

    def read(self, state: State) -> State:
        """The state by all records. Raises `RunFileError`, or `UsageError` if there is no such file."""
        with RunReader.open(self.path) as reader:
            self._check(reader)
            for record in reader.records():
                state.add(record)
        return state

    def _check(self, reader: RunReader) -> None:
        if self.mark not in reader.documents():
            raise UsageError(f"{self.path} is not a {self.what}, but the file of a run or loop")
