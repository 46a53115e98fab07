"""What a damaged run file still proves, in a new one: its records from the first on, as far as the chain holds.

Every record is held against its hash, every document and the run list against the digests in the first record: what is
in the new file is what was written, to the last bit, or it is not there.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import apsw

from procedures import Factor, Point, RunList
from rig.engine.chain import GENESIS, Record, link
from rig.engine.last_word import read_last_word
from rig.engine.pages import Pages, Row
from rig.engine.run_reader import RunReader
from rig.engine.schema import APPLICATION_ID, INSERT_RECORD, SCHEMA_VERSION, statements, write_run_list
from rig.engine.storage import storage_of
from rig.errors import RunFileError, StorageError, UsageError

Expand = Callable[[Mapping[str, str]], RunList | None]
_Chained = tuple[int, Record, bytes, bytes]
_COLUMNS = 12


@dataclass(frozen=True)
class Restored:
    """What was saved.

    Attributes:
        records: in the new file.
        known: how many the damaged one is known to have had at least.

    """

    records: int
    known: int


def restore(path: Path, to: Path, expand: Expand) -> Restored:
    """Write the longest proven beginning of a damaged run file into a new one. Changes nothing in the old.

    Args:
        path: the damaged file.
        to: the new one, which must not exist.
        expand: makes the run list from documents, None if it cannot.

    Raises:
        UsageError: the new file exists already, or the old one does not.
        RunFileError: not even what the run is can be read.
        StorageError: the disk refuses.

    """
    if to.exists():
        raise UsageError(f"{to} exists already; a run is never overwritten")
    if not path.is_file():
        raise UsageError(f"there is no run file {path}")
    part, disk = to.with_name(to.name + ".part"), storage_of("")
    try:
        disk.make_folder(to.parent)
        part.unlink(missing_ok=True)
        db = apsw.Connection(str(part))
        try:
            found = _fill(db, path, expand)
        finally:
            db.close()
        with RunReader.open(part) as run:
            run.verify()
        disk.replace(part, to)
        disk.sync_folder(to.parent)
    except (apsw.Error, OSError) as error:
        raise StorageError(f"cannot restore into {to}: {error}. {path} was not changed") from error
    finally:
        with contextlib.suppress(OSError):
            os.unlink(part)
    last = read_last_word(path)
    return Restored(found[0], max(*found, last[0] if last else 0))


def _fill(db: apsw.Connection, path: Path, expand: Expand) -> tuple[int, int]:
    """How many records were proven, and the highest number seen."""
    pages = Pages(path)
    documents: dict[str, set[str]] = defaultdict(set)
    db.pragma("application_id", APPLICATION_ID)
    db.pragma("user_version", SCHEMA_VERSION)
    db.execute("BEGIN IMMEDIATE")
    fixed = statements([])
    for name in ("document", "factor", "record", "one_accepted_observation"):
        db.execute(fixed[name])
    first, count, seen = None, 0, 0
    waiting: dict[int, list[_Chained]] = defaultdict(list)
    head = GENESIS
    for row in pages.rows():
        if len(row[1]) == 2 and all(isinstance(v, str) for v in row[1]):
            documents[str(row[1][0])].add(str(row[1][1]))
            continue
        chained = _record(row)
        if chained is None or chained[0] <= count:
            continue
        seen = max(seen, chained[0])
        waiting[chained[0]].append(chained)
        while (following := _next(waiting.pop(count + 1, []), head)) is not None:
            count, record, previous, head = following
            first = first or record
            db.execute(INSERT_RECORD, (count, *record, previous, head))
    if first is None:
        raise RunFileError(f"{path} is too damaged: not even its first record, which says what the run is, can be read")
    intact = _documents(path, first.data, documents)
    db.executemany("INSERT INTO document VALUES (?, ?)", list(intact.items()))
    _make_run_list(db, _run_list(path, first.data, intact, pages, expand))
    db.execute("COMMIT")
    return count, seen


def _record(row: Row) -> _Chained | None:
    """A row as a record of a run file that has its hash; None if it is none."""
    seq, c = row
    if len(c) != _COLUMNS or c[0] is not None or not (isinstance(c[10], bytes) and isinstance(c[11], bytes)):
        return None
    values: list[Any] = [*c[1:3], _real(c[3]), _real(c[4]), *c[5:10]]
    with contextlib.suppress(TypeError, ValueError):
        record = Record(*values)
        if link(c[10], seq, record) == c[11]:
            return seq, record, c[10], c[11]
    return None


def _real(value: object) -> object:
    """A column of real numbers, where whole ones are stored as such."""
    return float(value) if isinstance(value, int) else value


def _next(candidates: list[_Chained], head: bytes) -> _Chained | None:
    return next((c for c in candidates if c[2] == head), None)


def _documents(path: Path, declared: Mapping[str, Any], found: Mapping[str, set[str]]) -> dict[str, str]:
    intact = {}
    for name, digest in declared["documents"].items():
        texts = (text for text in found.get(name, ()) if hashlib.sha256(text.encode()).hexdigest() == digest)
        text = next(texts, None)
        if text is None:
            raise RunFileError(
                f"{path}: the document {name} that the run began with cannot be read: nothing can be restored; "
                f"`rig export {path} --salvage --out DATA.csv` may still save observations"
            )
        intact[name] = text
    return intact


def _run_list(
    path: Path, declared: Mapping[str, Any], documents: Mapping[str, str], pages: Pages, expand: Expand
) -> RunList:
    """The run list, made anew from the procedure or read; it must have the digest that the first record names."""
    ways: tuple[Callable[[], RunList | None], ...] = (
        lambda: expand(documents),
        lambda: _stored_run_list(pages, int(declared["seed"])),
    )
    for make in ways:
        with contextlib.suppress(ValueError, TypeError, KeyError):
            run_list = make()
            if run_list is not None and run_list.sha256() == declared["run_list"]:
                return run_list
    raise RunFileError(f"{path}: its run list can neither be made anew nor read: nothing can be restored")


def _stored_run_list(pages: Pages, seed: int) -> RunList:
    factors: dict[int, Factor] = {}
    points: dict[int, tuple[Any, ...]] = {}
    for key, c in pages.rows():
        values: tuple[Any, ...] = c
        if len(c) == 6 and c[0] is None and isinstance(c[1], str) and isinstance(c[2], str):
            factors.setdefault(key, Factor(values[1], values[2], float(values[3]), bool(values[4]), bool(values[5])))
        elif len(c) >= 5 and c[0] is None and all(isinstance(v, int | float) or v is None for v in c[1:]):
            points.setdefault(key, values)
    n = len(factors)
    return RunList([factors[i] for i in range(n)], _points(points, n), seed)


def _points(stored: Mapping[int, tuple[Any, ...]], factors: int) -> Iterator[Point]:
    for index, c in sorted(stored.items()):
        if len(c) == 3 + 2 * factors:
            yield Point(index, c[1], c[2], tuple(map(float, c[3 : 3 + factors])), c[3 + factors :])


def _make_run_list(db: apsw.Connection, runs: RunList) -> None:
    for name, statement in statements([f.name for f in runs.factors]).items():
        if name == "point" or "_refuses_" in name:
            db.execute(statement)
    write_run_list(db, runs)
