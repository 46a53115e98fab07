"""Creating a run file: the definition of the run is written before anything moves, and never changes."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import apsw

from rig.errors import RunFileError, StorageError
from rig.procedures.plan.run_list import RunList
from rig.run_file.chain import GENESIS, Record, encode, link
from rig.run_file.events.event import EMPTY
from rig.run_file.events.sessions import RunCreated
from rig.run_file.schema import APPLICATION_ID, INSERT_RECORD, SCHEMA_VERSION, statements, write_run_list
from rig.run_file.storage import storage_of


@dataclass(frozen=True)
class Genesis:
    """The definition of a run, fixed at its creation.

    Attributes:
        run_id: name of the run and of its file.
        documents: the bench, procedure (and, for a dry run, world) files as given, by name.
        run_list: every point.
        simulated: whether no real instrument is involved.
        about: software versions and other facts to keep with the run.

    """

    run_id: str
    documents: Mapping[str, str]
    run_list: RunList
    simulated: bool
    about: Mapping[str, Any]


def create(path: Path, genesis: Genesis, *, elapsed_s: float, utc_s: float, vfs: str = "") -> None:
    """Create a run file: either complete and durable under its final name, or not at all.

    Raises:
        StorageError: the file cannot be written.
        RunFileError: the name exists already.

    """
    if path.exists():
        raise RunFileError(f"{path} exists already; a run is never overwritten")
    part, disk = path.with_name(path.name + ".part"), storage_of(vfs)
    try:
        disk.make_folder(path.parent)
        disk.remove(part)
        db = apsw.Connection(str(part), vfs=vfs or None)
        try:
            _fill(db, genesis, elapsed_s, utc_s)
        finally:
            db.close()
        disk.replace(part, path)  # the name appears only when the contents are durable
        disk.sync_folder(path.parent)  # otherwise a power cut may take the name back
    except (apsw.Error, OSError) as error:
        for name in (part, part.with_name(part.name + "-journal"), path):
            with contextlib.suppress(OSError):
                disk.remove(name)
        raise StorageError(f"cannot create {path}: {error}. Nothing was moved and nothing is left behind.") from error


def _fill(db: apsw.Connection, genesis: Genesis, elapsed_s: float, utc_s: float) -> None:
    runs = genesis.run_list
    db.pragma("application_id", APPLICATION_ID)
    db.pragma("user_version", SCHEMA_VERSION)
    db.pragma("synchronous", "full")  # synced before the rename
    db.execute("BEGIN IMMEDIATE")
    for statement in statements([f.name for f in runs.factors]).values():
        db.execute(statement)
    db.executemany("INSERT INTO document VALUES (?, ?)", list(genesis.documents.items()))
    write_run_list(db, runs)
    event = RunCreated(
        run_id=genesis.run_id,
        simulated=genesis.simulated,
        documents={name: _digest(text) for name, text in genesis.documents.items()},
        run_list=runs.sha256(),
        points=len(runs),
        seed=runs.seed,
        by_hand=[step.as_json() for step in runs.steps] or EMPTY,
        **genesis.about,
    )
    first = Record(0, event.kind, elapsed_s, utc_s, body=encode(event.body()))
    row = (1, *first, GENESIS, link(GENESIS, 1, first))
    db.execute(INSERT_RECORD, row)
    db.execute("COMMIT")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
