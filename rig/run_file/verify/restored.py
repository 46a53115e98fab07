"""Restoring a damaged run file: a new file with its records from the first one, as far as the chain holds.

Every record is checked against its hash, every document and the run list against the digests in the first record. So
the new file contains only what was written originally, bit by bit.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import apsw

from rig.errors import RunFileError, StorageError, UsageError
from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.procedures.present.shell import shell_word
from rig.run_file.bodies import ContentsError
from rig.run_file.damage.audit import findings
from rig.run_file.damage.pages import Pages, Value
from rig.run_file.damage.proven import Chained, Chains, Other
from rig.run_file.events.sessions import RunCreated
from rig.run_file.last_word import head_path, read_last_word
from rig.run_file.live import live_path, request_path
from rig.run_file.read.reader import RunReader
from rig.run_file.schema import APPLICATION_ID, INSERT_RECORD, SCHEMA_VERSION, statements, write_run_list
from rig.run_file.storage import storage_of

Expand = Callable[[Mapping[str, str]], RunList | None]
_MOST_RUNS, _MOST_OTHERS = 10, 5


@dataclass(frozen=True)
class Restored:
    """The result of restoring.

    Attributes:
        records: number of records in the new file.
        known: known minimum number of records of this run in the damaged file.
        others: other chains that were found, the longest first, at most five.

    """

    records: int
    known: int
    others: tuple[Other, ...] = ()


@dataclass(frozen=True)
class _Run:
    """Contents of the new file."""

    tip: bytes
    documents: dict[str, str]
    run_list: RunList


def restore(path: Path, to: Path, expand: Expand, head: str = "") -> Restored:
    """Write the longest proven chain of a damaged run file into a new one. The old file is not changed.

    Args:
        path: the damaged file.
        to: the new file; neither it nor a file beside it may exist.
        expand: generates the run list from documents; None if it cannot.
        head: first hexadecimal digits of the hash of a record that the chain must have; "" for the longest
            chain.

    Raises:
        UsageError: the new file or a file beside it exists already, or the old file does not exist.
        RunFileError: not even the definition of the run can be read, or no chain has that record.
        StorageError: the new file cannot be written.

    """
    _check_free(to)
    if not path.is_file():
        raise UsageError(f"there is no run file {path}")
    disk = storage_of("")
    part = to.with_name(f"restore-{secrets.token_hex(12)}.part")
    made = False
    try:
        pages = Pages(path)
        chains = Chains.found_in(pages)
        run = _chosen(path, chains, pages, expand, head)
        disk.make_folder(to.parent)
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o644))
        made = True
        db = apsw.Connection(str(part))
        try:
            count = _fill(db, run, [*reversed(chains.path(run.tip))], chains, pages)
        finally:
            db.close()
        with RunReader.open(part) as written:
            wrong = next(findings(written, thorough=False), None)
        if wrong is not None:
            raise RunFileError(f"{path}: its records hold, but make no run ({wrong}): nothing was restored")
        _check_free(to)
        disk.replace(part, to)
        disk.sync_folder(to.parent)
        with RunReader.open(to) as written:  # under the final name SQLite may find other files beside it
            if written.head() != (count, run.tip):
                raise RunFileError(f"{to} is not what was written there: something else works in {to.parent}")
    except apsw.ConstraintError as error:
        raise RunFileError(f"{path}: its records hold, but make no run ({error}): nothing was restored") from error
    except (apsw.Error, OSError) as error:
        raise StorageError(f"cannot restore into {to}: {error}. {path} was not changed") from error
    finally:
        for one in (part, part.with_name(part.name + "-journal")) if made else ():
            with contextlib.suppress(OSError):
                os.unlink(one)
    known = chains.known(chains.first(run.tip), read_last_word(path))
    return Restored(count, max(count, known), tuple(chains.others(run.tip, pages, _MOST_OTHERS)))


def _check_free(to: Path) -> None:
    """Refuse an existing name, or a name with a file beside it that SQLite would take for a part of the new one."""
    if os.path.lexists(to):
        raise UsageError(f"{to} exists already; a run is never overwritten: choose another name")
    aside = (head_path(to), live_path(to), request_path(to))
    if to in aside:
        raise UsageError(f"{to} would be taken for what lies beside a run file: choose a name that ends in .sqlite")
    for one in (*(to.with_name(to.name + suffix) for suffix in ("-wal", "-journal", "-shm")), *aside):
        if os.path.lexists(one):
            raise UsageError(
                f"{one} is there and would be taken for a part of {to}: nothing was written. "
                f"Choose another name, or move it away if it belongs to nothing"
            )


def _chosen(path: Path, chains: Chains, pages: Pages, expand: Expand, head: str) -> _Run:
    """The longest chain whose documents and run list can be read too."""
    tips = chains.tips(head)
    if not tips and head and (longest := chains.tips()):
        raise RunFileError(
            f"{path}: no chain that is proven has a record whose hash begins with {head}: nothing was restored. "
            f"Without --head the longest is, of {len(chains.path(longest[0]))} records"
        )
    first: RunFileError | None = None
    tried: set[bytes] = set()
    for tip in tips:
        if chains.first(tip) in tried:
            continue
        tried.add(chains.first(tip))
        try:
            declared = _declared(path, chains.read(chains.first(tip), pages))
            documents = _documents(path, declared, chains, pages)
            return _Run(tip, documents, _run_list(path, declared, documents, pages, expand))
        except RunFileError as error:
            first = first or error
        if len(tried) == _MOST_RUNS:
            break
    raise first or RunFileError(
        f"{path} is too damaged: not even its first record, which says what the run is, can be read"
    )


def _fill(db: apsw.Connection, run: _Run, path: Iterable[bytes], chains: Chains, pages: Pages) -> int:
    """Write everything; returns the number of records."""
    db.pragma("application_id", APPLICATION_ID)
    db.pragma("user_version", SCHEMA_VERSION)
    db.execute("BEGIN IMMEDIATE")
    objects = statements([f.name for f in run.run_list.factors])
    for name, statement in objects.items():
        if "_refuses_" not in name:
            db.execute(statement)
    count = 0
    for own in path:
        count, record, previous, _ = chains.read(own, pages)
        db.execute(INSERT_RECORD, (count, *record, previous, own))
    db.executemany("INSERT INTO document VALUES (?, ?)", list(run.documents.items()))
    write_run_list(db, run.run_list)
    for name, statement in objects.items():
        if "_refuses_" in name:
            db.execute(statement)
    db.execute("COMMIT")
    return count


def _declared(path: Path, first: Chained) -> RunCreated:
    """The definition of the run, by the first record."""
    with contextlib.suppress(ContentsError):
        if isinstance(event := first[1].event, RunCreated):
            return event
    raise RunFileError(f"{path}: its first record does not say what the run is: nothing can be restored")


def _documents(path: Path, declared: RunCreated, chains: Chains, pages: Pages) -> dict[str, str]:
    intact = {}
    for name, digest in declared.documents.items():
        places = chains.documents.get((name, str(digest)), ())
        text = next((text for place in places for text in _texts(pages, place, name, digest)), None)
        if text is None:
            raise RunFileError(
                f"{path}: the document {name} that the run began with cannot be read: nothing can be restored; "
                f"`rig export {shell_word(path)} --salvage --out DATA.csv` may still save observations"
            )
        intact[name] = text
    return intact


def _texts(pages: Pages, place: int, name: str, digest: str) -> Iterator[str]:
    for _, c in pages.rows(place):
        text = c[1] if len(c) == 2 and c[0] == name else None
        if isinstance(text, str) and hashlib.sha256(text.encode()).hexdigest() == digest:
            yield text


def _run_list(path: Path, declared: RunCreated, documents: Mapping[str, str], pages: Pages, expand: Expand) -> RunList:
    """The run list, generated from the procedure or read from the pages; it must have the digest in the first
    record.
    """
    ways: tuple[Callable[[], RunList | None], ...] = (
        lambda: expand(documents),
        lambda: _stored_run_list(pages, declared, latest=False),
        lambda: _stored_run_list(pages, declared, latest=True),
    )
    for make in ways:
        with contextlib.suppress(ValueError, TypeError, KeyError):
            run_list = make()
            if run_list is not None and run_list.sha256() == declared.run_list:
                statements([factor.name for factor in run_list.factors])  # raises for a name that cannot be a column's
                return run_list
    raise RunFileError(f"{path}: its run list can neither be made again nor read: nothing can be restored")


def _stored_run_list(pages: Pages, declared: RunCreated, *, latest: bool) -> RunList:
    """Run lists from the pages: of the file and, if it differs, of the end of the log."""
    factors: dict[int, Factor] = {}
    points: dict[int, tuple[Any, ...]] = {}
    for _, rows in pages.cells():
        for key, c in rows:
            _take(key, c, factors, points, latest=latest)
    n = len(factors)
    return RunList([factors[i] for i in range(n)], _points(points, n), declared.seed, declared.steps)


def _take(
    key: int, c: tuple[Value, ...], factors: dict[int, Factor], points: dict[int, tuple[Any, ...]], *, latest: bool
) -> None:
    values: tuple[Any, ...] = c
    if len(c) == 6 and c[0] is None and isinstance(c[1], str) and isinstance(c[2], str):
        if latest or key not in factors:
            factors[key] = Factor(values[1], values[2], float(values[3]), bool(values[4]), bool(values[5]))
    elif len(c) >= 5 and all(isinstance(v, int | float) or v is None for v in c) and (latest or key not in points):
        points[key] = values


def _points(stored: Mapping[int, tuple[Any, ...]], factors: int) -> Iterator[Point]:
    for index, c in sorted(stored.items()):
        if len(c) == 3 + 2 * factors:
            yield Point(index, c[1], c[2], tuple(map(float, c[3 : 3 + factors])), c[3 + factors :])
