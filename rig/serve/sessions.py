"""Who is logged in: sessions by cookie, tokens against forged forms, and patience with wrong passwords."""

from __future__ import annotations

import hmac
import secrets
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from rig.lab import People, Person, proven
from rig.who import Operator

IDLE_S, LONGEST_S = 2 * 3600.0, 12 * 3600.0
"""A session ends after this time without a request, and after this time in any case."""
_MOST_SESSIONS, _MOST_KEYS = 500, 5000
_FREE, _FIRST_S, _LONGEST_WAIT_S = 5, 2.0, 900.0


@dataclass
class Session:
    """A person who is logged in.

    Attributes:
        login: of the person.
        person: entry when the session began.
        csrf: is in every form of this session's pages.
        began_s: when it began, stopwatch seconds.
        seen_s: time of the last request.
        by: what proved who it is.
    """

    login: str
    person: Person
    csrf: str
    began_s: float
    seen_s: float
    by: Literal["password", "passkey"] = "password"

    @property
    def operator(self) -> Operator:
        """The person, for records."""
        return proven(self.login, self.person, self.by)

    def wrote(self, given: str) -> bool:
        """Whether a form is one of this session's pages; takes equally long for a wrong one."""
        return hmac.compare_digest(given.encode("utf-8", "replace"), self.csrf.encode())

    def may(self, role: str) -> bool:
        """Whether the person has a role."""
        return role in self.person.roles


class Sessions:
    """All sessions; in memory only, so that a restart ends them.

    Args:
        people: the people as they are now: who was removed or changed is logged out.
        now: stopwatch seconds.
    """

    def __init__(self, people: Callable[[], People], now: Callable[[], float]) -> None:
        self._people, self._now = people, now
        self._all: OrderedDict[str, Session] = OrderedDict()

    def begin(self, login: str, person: Person, by: Literal["password", "passkey"] = "password") -> str:
        """A new session; returns the value of its cookie."""
        while len(self._all) >= _MOST_SESSIONS:
            self._all.popitem(last=False)
        cookie, now = secrets.token_urlsafe(32), self._now()
        self._all[cookie] = Session(login, person, secrets.token_urlsafe(32), now, now, by)
        return cookie

    def of(self, cookie: str, *, seen: bool = True) -> Session | None:
        """The session with this cookie; None if there is none, or it has ended. A stream is not `seen` as a request."""
        session, now = self._all.get(cookie), self._now()
        if session is None:
            return None
        over = now - session.seen_s > IDLE_S or now - session.began_s > LONGEST_S
        if over or self._people().people.get(session.login) != session.person:
            self.end(cookie)
            return None
        if seen:
            session.seen_s = now
            self._all.move_to_end(cookie)
        return session

    def keep(self, cookie: str) -> None:
        """Go on with a session whose person has just changed the own entry; other sessions of this person end."""
        session = self._all.get(cookie)
        if session is not None and (person := self._people().people.get(session.login)) is not None:
            session.person = person

    def end(self, cookie: str) -> None:
        """End a session."""
        self._all.pop(cookie, None)


class Patience:
    """How long somebody has to wait after wrong passwords: not at all five times, then twice as long each time.

    Attempts under way count as wrong ones until they are judged: who sends many at once waits, too.

    Args:
        now: stopwatch seconds.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._failed: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._open: Counter[str] = Counter()

    def wait_s(self, *keys: str) -> float:
        """Seconds until one with these keys (address, address and login) may try again; 0 for now."""
        return max((self._until(key) for key in keys), default=0.0)

    def _until(self, key: str) -> float:
        count, last_s = self._failed.get(key, (0, 0.0))
        if count + self._open[key] < _FREE:
            return 0.0
        if self._open[key]:
            return _FIRST_S  # of a number of attempts, one may be right: it is not kept out for longer
        wait_s = min(_LONGEST_WAIT_S, _FIRST_S * 2.0 ** min(count - _FREE, 20))
        return max(0.0, last_s + wait_s - self._now())

    @contextmanager
    def attempt(self, *keys: str) -> Iterator[Attempt]:
        """An attempt; it is a right one unless its block says otherwise."""
        attempt = Attempt()
        self._open.update(keys)
        try:
            yield attempt
        except BaseException:
            attempt.failed = True
            raise
        finally:
            self._open.subtract(keys)
            self._open += Counter()  # those of zero go
            (self._wrong if attempt.failed else self._right)(keys)

    def _wrong(self, keys: Iterable[str]) -> None:
        for key in keys:
            count, _ = self._failed.pop(key, (0, 0.0))
            self._failed[key] = (count + 1, self._now())
            while len(self._failed) > _MOST_KEYS:
                self._failed.popitem(last=False)

    def _right(self, keys: Iterable[str]) -> None:
        for key in keys:
            self._failed.pop(key, None)


@dataclass
class Attempt:
    """An attempt to log in.

    Attributes:
        failed: whether it was wrong.
    """

    failed: bool = False
