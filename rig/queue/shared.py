"""A queue in a PostgreSQL database, which several machines share: the records of a queue's file, chained as there.

One machine adds items for another, and all see the same state. Each machine carries out its own items: benches hang on
machines. What its wire to the database does never disturbs a run: runs are processes with files of their own.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import sqlalchemy as sql

from rig.database import WAIT_S, Database
from rig.drivers.clock import RealClock
from rig.errors import RunFileError, StorageError
from rig.queue.file import Keeps, Queue, numbered, only_worker
from rig.run_file.chain import GENESIS, Record, StoredRow, encode, followed, link
from rig.run_file.events.event import Event
from rig.run_file.last_word import LastWord, head_path, read_last_word

TABLE = "rig_queue"
_TRIES, _AGAIN_S = 3, 1.0
_WRITING = 7_261_642
"""Number of the lock of those who write, or make the table."""
_RECORDS = sql.Table(
    TABLE,
    sql.MetaData(),
    sql.Column("seq", sql.BigInteger, primary_key=True, autoincrement=False),
    sql.Column("session", sql.Integer, nullable=False),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("elapsed_s", sql.Double, nullable=False),
    sql.Column("utc_s", sql.Double, nullable=False),
    sql.Column("run_index", sql.Integer),
    sql.Column("whole_plot", sql.Integer),
    sql.Column("attempt", sql.Integer),
    sql.Column("status", sql.Text),
    sql.Column("body", sql.Text, nullable=False),
    sql.Column("previous", sql.LargeBinary, nullable=False),
    sql.Column("hash", sql.LargeBinary, nullable=False),
    sql.Column("written", sql.Text, nullable=False),  # by which call: a commit without an answer is found again
)


@dataclass(frozen=True)
class SharedQueue(Keeps):
    """A queue in a database.

    Attributes:
        database: that has its table.
        own: name of the machine whose items are carried out here.
        beside: path in the folder in which items have theirs; `.head` beside it has the last record that was seen.

    Example:
        >>> database = Database("postgresql://rig@db.lab/queue")
        >>> SharedQueue(database, "bench-2", Path("runs/queue.sqlite")).folder_of(3)
        PosixPath('runs/queue-3')
    """

    database: Database
    own: str
    beside: Path

    @property
    def machine(self) -> str:
        """See `Keeps`."""
        return self.own

    @property
    def patient(self) -> bool:
        """See `Keeps`."""
        return True

    def folder_of(self, item: int) -> Path:
        """See `Keeps`."""
        return self.beside.with_name(f"{self.beside.stem}-{item}")

    def only_worker(self) -> AbstractContextManager[None]:
        """See `Keeps`: of this machine and folder. Two of one machine never begin one item: the database decides."""
        return only_worker(self.beside.with_suffix(".worker"), f"the queue of {self.machine} in {self.database.named}")

    def changes(self) -> object:
        """See `Keeps`."""
        with self.database.reached("the queue") as db:
            if not sql.inspect(db).has_table(TABLE):
                return None
            return db.execute(sql.select(sql.func.max(_RECORDS.c.seq))).scalar()

    def read(self) -> Queue:
        """See `Keeps`; an empty one if there is none yet."""
        with self.database.reached("the queue") as db:
            return self._folded(self._rows(db) if sql.inspect(db).has_table(TABLE) else [])

    def decide(self, by: Callable[[Queue], Sequence[Event]]) -> Queue:
        """See `Keeps`."""
        written, clock = uuid.uuid4().hex, RealClock()
        for left in range(_TRIES - 1, -1, -1):
            try:
                with self.database.reached("the queue") as db, db.begin():
                    queue, last = self._decided(db, by, written, clock.utc())
            except StorageError:  # it may have been written all the same: `written` tells
                if not left:
                    raise
                clock.sleep(_AGAIN_S)
            else:
                self._seen(*last)  # not before the commit: it may be behind, never ahead
                return queue
        raise AssertionError

    def _decided(
        self, db: sql.Connection, by: Callable[[Queue], Sequence[Event]], written: str, utc_s: float
    ) -> tuple[Queue, tuple[int, bytes]]:
        """The state with new records, and number and hash of the last one."""
        db.execute(sql.text(f"SET LOCAL lock_timeout = '{WAIT_S}s'"))
        db.execute(sql.text("SET LOCAL synchronous_commit = on"))
        # not LOCK TABLE, which asks for the right to change records
        db.execute(sql.text(f"SELECT pg_advisory_xact_lock({_WRITING})"))
        _RECORDS.create(db, checkfirst=True)
        rows = self._rows(db)
        queue = self._folded(rows)
        if db.execute(sql.select(sql.func.count()).where(_RECORDS.c.written == written)).scalar():
            return queue, (len(rows), rows[-1][-1])
        first_s, previous, seq = (rows[0][4], rows[-1][-1], len(rows)) if rows else (utc_s, GENESIS, 0)
        for seq, event in enumerate(numbered(queue, by(queue)), len(rows) + 1):
            own = Record(
                0, event.kind, max(0.0, utc_s - first_s), utc_s, status=event.status, body=encode(event.body())
            )
            hashed = link(previous, seq, own)
            values = dict(zip(_RECORDS.c.keys(), (seq, *own, previous, hashed, written), strict=True))
            db.execute(sql.insert(_RECORDS).values(values))
            queue.add(own)
            previous = hashed
        return queue, (seq, previous)

    def _rows(self, db: sql.Connection) -> list[StoredRow]:
        columns = [column for column in _RECORDS.c if column.name != "written"]
        return [tuple(row) for row in db.execute(sql.select(*columns).order_by(_RECORDS.c.seq))]

    def _folded(self, rows: list[StoredRow]) -> Queue:
        """The state by records that are checked. Raises `RunFileError`."""
        held, queue, where = followed(rows, 1, GENESIS), Queue(), f"{TABLE} in {self.database.named}"
        if held < len(rows):
            raise RunFileError(
                f"record {held + 1} of {where} is not as it was written, or records before it are "
                "missing: nothing is added or begun. Put the table back from a backup"
            )
        count, head = read_last_word(self.beside) or (0, b"")
        if count > len(rows) or (count and rows[count - 1][-1] != head):
            raise RunFileError(
                f"{where} has lost its last records, of {count} that {head_path(self.beside)} counts: "
                f"nothing is added or begun. Put the table back from a backup; for a new queue remove that file"
            )
        for row in rows:
            queue.add(Record._make(row[1:10]))
        if len(rows) > count:
            self._seen(len(rows), rows[-1][-1])
        return queue

    def _seen(self, count: int, head: bytes) -> None:
        """Note beside the folder which records there were."""
        if not count:
            return
        self.beside.parent.mkdir(parents=True, exist_ok=True)
        said = LastWord(self.beside)
        said.say(count, head)
        said.close(finished=False)
