"""What a campaign has done so far, in a file: killed at any moment, it goes on where it was, and no seed counts twice.

The file is SQLite's, not lines with an fsync, for three things that lines leave to us: a block of results is there as a
whole or not at all, a seed cannot be there twice (its primary key), and a second campaign on the same file is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import apsw

from rig.errors import UsageError

Result = dict[str, Any]
"""Of one seed, made of what JSON has."""

_SCHEMA = """
CREATE TABLE IF NOT EXISTS campaign(name TEXT PRIMARY KEY, source TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS result(
    campaign TEXT NOT NULL REFERENCES campaign, seed INTEGER NOT NULL, result TEXT NOT NULL,
    PRIMARY KEY (campaign, seed)
);
CREATE TRIGGER IF NOT EXISTS result_stays BEFORE UPDATE ON result BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER IF NOT EXISTS result_is_kept BEFORE DELETE ON result BEGIN SELECT RAISE(ABORT, 'append only'); END;
"""


class Ledger:
    """Results of campaigns by seed, in a file that is only added to.

    Args:
        path: of the file; made where there is none.

    Raises:
        UsageError: another campaign has it open, or it is no ledger.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._db = apsw.Connection(str(path))
            self._db.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._db.execute("PRAGMA synchronous = EXTRA")  # the folder too, when the rollback journal is removed
            self._db.execute(f"BEGIN EXCLUSIVE; {_SCHEMA} COMMIT")  # the lock is kept
        except apsw.BusyError:
            raise UsageError(f"{path}: another campaign has this ledger open") from None
        except apsw.Error as error:
            raise UsageError(f"{path}: not a ledger of a campaign: {error}") from error

    def begin(self, campaign: str, source: str) -> None:
        """Begin a campaign, or go on with it.

        Raises:
            UsageError: it was begun with another state of the program.

        """
        with self._db:
            self._db.execute("INSERT OR IGNORE INTO campaign VALUES (?, ?)", (campaign, source))
        ((was,),) = self._db.execute("SELECT source FROM campaign WHERE name = ?", (campaign,))
        if was != source:
            raise UsageError(
                f"{self._path}: this campaign was begun with another state of the program, and results of two "
                f"programs do not count together: name another file"
            )

    def done(self, campaign: str, seeds: range) -> dict[int, Result]:
        """Results that are there of consecutive seeds."""
        asked = (campaign, seeds.start, seeds.stop)
        rows = self._db.execute("SELECT seed, result FROM result WHERE campaign = ? AND seed >= ? AND seed < ?", asked)
        return {seed: json.loads(result) for seed, result in rows}

    def add(self, campaign: str, results: Mapping[int, Result]) -> None:
        """Add results of a block, durably, all of them or none.

        Raises:
            apsw.ConstraintError: one is there already.

        """
        rows: Iterable[tuple[str, int, str]] = ((campaign, seed, json.dumps(one)) for seed, one in results.items())
        with self._db:
            self._db.executemany("INSERT INTO result VALUES (?, ?, ?)", rows)

    def close(self) -> None:
        """Close the file, for others to open."""
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()
