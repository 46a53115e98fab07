"""Carrying out acts for people and programs: role, password and confirmation first, from pages and API alike."""

from __future__ import annotations

import multiprocessing
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from anyio import CapacityLimiter, to_thread
from starlette.exceptions import HTTPException

from rig.acts import Act, Places, Told
from rig.errors import RigError, UsageError
from rig.lab import Laboratory, Person, WrongPassword, by_password, check_role
from rig.serve.sessions import Patience
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
    _slow: ProcessPoolExecutor | None = None

    async def password(self, login: str, password: str, address: str) -> Person:
        """The person with this password.

        Raises:
            WrongPassword: there is none.
            HTTPException: too many were wrong, or too many are being checked.
        """
        keys = (f"from {address}", f"{login[:80]} from {address}")
        wait_s = self.patience.wait_s(*keys)
        if wait_s > 0.0:
            raise HTTPException(429, _WAIT.format(wait_s), {"retry-after": f"{wait_s + 1:.0f}"})
        if self._waiting >= _MOST_WAITING:
            raise HTTPException(503, "too many passwords are being checked", {"retry-after": "2"})
        self._waiting += 1
        try:
            people = self.places.laboratory.people()
            person = await to_thread.run_sync(by_password, people, login, password, limiter=self._passwords)
        except WrongPassword:
            self.patience.failed(*keys)
            raise
        finally:
            self._waiting -= 1
        self.patience.right(*keys)
        return person

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
        """Do it. Raises `RigError`."""
        if not act.slow:
            return await to_thread.run_sync(act.carry_out, self.places, by)
        if self._slow is None:  # begun by spawning: this process has threads
            context = multiprocessing.get_context("spawn")
            self._slow = ProcessPoolExecutor(2, mp_context=context)
        job = self._slow.submit(_apart, type(act).name, act.model_dump(), self.places.laboratory, by)
        told = await to_thread.run_sync(job.result, abandon_on_cancel=True)
        if isinstance(told, RigError):
            raise told
        return told

    def close(self) -> None:
        """End the processes of slow acts."""
        if self._slow is not None:
            self._slow.shutdown(wait=False, cancel_futures=True)


_WAIT = "Too many wrong passwords. Wait {:.0f} s."
_MOST_WAITING = 20


def _apart(name: str, values: Mapping[str, Any], laboratory: Laboratory, by: Operator) -> Told | RigError:
    """An act in a process of its own; an error for people is returned, since some cannot be pickled as raised."""
    from rig.acts import act_of  # noqa: PLC0415 - in the new process
    from rig.procedures.errors import DataError  # noqa: PLC0415

    try:
        given = {key: value for key, value in values.items() if value is not None}
        return act_of(name, given).carry_out(Places(laboratory), by)
    except (RigError, DataError) as error:
        return UsageError(str(error))
