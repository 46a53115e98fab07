"""Databases that several machines share: their addresses and what goes wrong on the way to them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rig.errors import BusyError, StorageError, UsageError

try:
    import sqlalchemy as sql
    from sqlalchemy.exc import ArgumentError, DBAPIError, OperationalError
except ImportError as missing:  # pragma: no cover - the extra is installed where tests run
    raise UsageError("a database needs the extra: pip install 'calibration-rig[postgresql]'") from missing

WAIT_S = 10
"""Seconds that a connection, or another writer, is waited for."""
_LOCK_NOT_AVAILABLE = "55P03"


@dataclass(frozen=True)
class Database:
    """A PostgreSQL database.

    Attributes:
        url: its address, `postgresql://NAME:PASSWORD@HOST/DATABASE`.

    Example:
        >>> Database("postgresql://rig:secret@db.lab/queue").named
        'postgresql://rig:***@db.lab/queue'
    """

    url: str

    @contextmanager
    def reached(self, what: str) -> Iterator[sql.Connection]:
        """A connection, for as long as it is used.

        Args:
            what: what is kept there, for messages.

        Raises:
            BusyError: somebody else writes for too long.
            StorageError: it cannot be reached, or not used.
        """
        try:
            with self._engine.connect() as db:
                yield db
        except OperationalError as error:
            if getattr(error.orig, "sqlstate", None) == _LOCK_NOT_AVAILABLE:
                raise BusyError(f"{self.named}: somebody else writes for more than {WAIT_S} s") from error
            raise StorageError(f"{what} in {self.named} cannot be reached ({_first_line(error)})") from error
        except DBAPIError as error:
            raise StorageError(f"{what} in {self.named} cannot be used ({_first_line(error)})") from error

    @cached_property
    def _engine(self) -> sql.Engine:
        settings = {"connect_timeout": WAIT_S, "application_name": "rig"}
        return sql.create_engine(self._parts, poolclass=sql.NullPool, connect_args=settings)

    @cached_property
    def _parts(self) -> sql.URL:
        try:
            parts = sql.make_url(self.url)
        except ArgumentError:
            raise UsageError("--database: an address such as postgresql://NAME@HOST/DATABASE") from None
        if parts.get_backend_name() != "postgresql":
            raise UsageError(f"--database: only postgresql://..., not {parts.get_backend_name()}://")
        return parts.set(drivername="postgresql+psycopg")

    @cached_property
    def named(self) -> str:
        """Its address without the password. Raises `UsageError` for one that is none."""
        return self._parts.set(drivername="postgresql").render_as_string(hide_password=True)


def _first_line(error: Any) -> str:
    return str(error.orig or error).strip().splitlines()[0]
