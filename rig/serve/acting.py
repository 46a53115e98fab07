"""Carrying out acts for people and programs: role, password and confirmation first, from pages and API alike."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from anyio import CapacityLimiter, to_thread
from starlette.exceptions import HTTPException

from rig.acts import Act, Places, Told
from rig.errors import RigError, UsageError
from rig.lab import Person, by_password, check_role
from rig.serve.apart import apart
from rig.serve.sessions import Attempt, Patience
from rig.who import Operator


class NotConfirmed(UsageError):
    """Something would move; the message says what."""


@dataclass
class Acting:
    """Carries out acts.

    Attributes:
        places: the laboratory's files.
        patience: with wrong passwords.
    """

    places: Places
    patience: Patience
    _passwords: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))  # 64 MB each
    _waiting: int = 0
    _slow: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))
    _at_work: set[str] = field(default_factory=set)
    _brief: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))

    async def password(self, login: str, password: str, address: str) -> Person:
        """The person with this password.

        Raises:
            WrongPassword: there is none.
            HTTPException: too many were wrong, or too many are being checked.
        """
        with self.patient(address, f"{login[:80]} from {address}"):
            people = self.places.laboratory.people()
            return await to_thread.run_sync(by_password, people, login, password, limiter=self._passwords)

    @contextmanager
    def patient(self, address: str, *keys: str) -> Iterator[Attempt]:
        """An attempt to log in from an address. Raises `HTTPException` if too many were wrong, or are under way."""
        wait_s = self.patience.wait_s(f"from {address}", *keys)
        if wait_s > 0.0:
            raise HTTPException(429, _WAIT.format(wait_s), {"retry-after": f"{wait_s + 1:.0f}"})
        if self._waiting >= _MOST_WAITING:
            raise HTTPException(503, "too many passwords are being checked", {"retry-after": "2"})
        self._waiting += 1
        try:
            with self.patience.attempt(f"from {address}", *keys) as attempt:
                yield attempt
        finally:
            self._waiting -= 1

    async def checked(self, act: Act, login: str, person: Person, *, confirmed: bool) -> None:
        """Raise unless a person may do this, and it is confirmed if something moves.

        Raises:
            UsageError: the role is missing, or it cannot be done.
            NotConfirmed: something would move.
        """
        check_role(login, person, act.role)
        will = await to_thread.run_sync(act.will, self.places)
        if act.moves and not confirmed:
            raise NotConfirmed(will)

    async def carry_out(self, act: Act, by: Operator) -> Told:
        """Do it, and log after it which files an editor has changed. Raises `RigError`."""
        if act.slow:
            told = await self._apart(act, by)
        else:
            told = await to_thread.run_sync(act.carry_out, self.places, by)
        with contextlib.suppress(RigError, OSError):  # the act was done, whether the log can be written or not
            await to_thread.run_sync(self.places.laboratory.note_changes, by)
        return told

    async def _apart(self, act: Act, by: Operator) -> Told:
        """A slow act in a process of its own; one of a person at a time, so that nobody waits for all of another."""
        if act.brief:
            return await to_thread.run_sync(apart, act, self.places.laboratory, by, limiter=self._brief)
        if by.name in self._at_work:
            raise UsageError(f"something of {by.name} is still at work; wait until it is done")
        self._at_work.add(by.name)
        try:
            return await to_thread.run_sync(apart, act, self.places.laboratory, by, limiter=self._slow)
        finally:
            self._at_work.discard(by.name)


_WAIT = "Too many wrong passwords. Wait {:.0f} s."
_MOST_WAITING = 20
