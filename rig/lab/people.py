"""People of a laboratory, `people.toml`: names, roles, and passwords as argon2id hashes.

A program has a token in place of a password: 43 random characters, of which the file has the SHA-256.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Mapping
from typing import Any, Literal, get_args

from pydantic import Field, field_validator

from rig.bench.config import parse_toml, validated
from rig.errors import UsageError
from rig.extras import needed
from rig.procedures.plan.settings import Strict
from rig.who import Operator

FILE = "people.toml"
Role = Literal["viewer", "operator", "approver", "administrator"]
ROLES: tuple[Role, ...] = get_args(Role)
LOGIN = r"[a-z][a-z0-9._-]{0,31}"
_SHORTEST, _LONGEST = 10, 1000
_READABLE = "abcdefghjkmnpqrstuvwxyz23456789"
COST: Mapping[str, int] = {}
"""Parameters of argon2id other than those of its library; only tests have any."""


class Passkey(Strict):
    """A passkey of a person, `[people.LOGIN.passkeys.NAME]`: a second way to log in."""

    id: str = Field(pattern=r"^[A-Za-z0-9_-]{1,1500}$", description="of the credential, base64url")
    key: str = Field(pattern=r"^[A-Za-z0-9_-]{1,3000}$", description="public key, COSE as base64url")


class Person(Strict):
    """One `[people.LOGIN]` table."""

    name: str = Field(min_length=1, max_length=80, description="name, for people and for run files")
    roles: tuple[Role, ...] = Field(
        min_length=1,
        description="viewer sees; operator starts, holds, answers; approver approves and signs; administrator keeps "
        "this file",
    )
    password: str = Field("", description="argon2id hash, written by `rig person`")
    token: str = Field("", description="SHA-256 of a program's token, written by `rig person`")
    disabled: bool = Field(False, description="whether it may log in no more; the log keeps what it did")
    passkeys: dict[str, Passkey] = Field({}, max_length=20, description="passkeys, written by the page People")

    @field_validator("name")
    @classmethod
    def _printable(cls, name: str) -> str:
        if not name.isprintable() or name != name.strip():
            raise ValueError("a name has printable characters, and none of them is blank at its ends")
        return name


class People(Strict):
    """A whole `people.toml`."""

    people: dict[str, Person] = Field(default_factory=dict)

    def having(self, role: str) -> list[str]:
        """Logins of the people with a role who may log in."""
        return [login for login, one in self.people.items() if role in one.roles and not one.disabled]


class WrongPassword(UsageError):
    """The login is unknown, or the password is wrong; which of them is not said."""


def parse_people(text: str, where: str) -> People:
    """Check the text of a `people.toml`. Raises `ConfigurationError`, in which no value is shown."""
    people: People = validated(People, parse_toml(text, where, shown=False), where, shown=False)
    for login in people.people:
        check_login(login)
    return people


def check_login(login: str) -> str:
    """The login. Raises `UsageError` if it is none."""
    if not re.fullmatch(LOGIN, login):
        raise UsageError(f"{login!r:.60} is not a login: a to z first, then also digits, '.', '_' and '-', 32 at most")
    return login


def hashed(password: str) -> str:
    """The argon2id hash of a new password. Raises `UsageError` if it is too short."""
    if not _SHORTEST <= len(password) <= _LONGEST:
        raise UsageError(f"a password has {_SHORTEST} to {_LONGEST} characters; this one has {len(password)}")
    made: str = _hasher().hash(password)
    return made


def new_token() -> tuple[str, str]:
    """A new token, and what the file has of it."""
    token = secrets.token_urlsafe(32)
    return token, _digest(token)


def by_password(people: People, login: str, password: str) -> Person:
    """The person with this login and password. Takes equally long for an unknown login.

    Raises:
        WrongPassword: there is no such person.
    """
    person = people.people.get(login)
    known = person.password if person is not None and person.password else _nobody()
    argon2 = needed("argon2", "serve")
    try:
        _hasher().verify(known, password[:_LONGEST])
    except (argon2.exceptions.VerificationError, argon2.exceptions.InvalidHashError):
        person = None
    if person is None or not person.password or person.disabled:
        raise WrongPassword("this login and password belong to nobody here; `rig person password` gives a new one")
    return person


def by_token(people: People, token: str) -> tuple[str, Person] | None:
    """Login and entry of the program with this token; None if there is none."""
    digest, found = _digest(token), None
    for login, one in people.people.items():  # all of them: the time says nothing
        if one.token and hmac.compare_digest(one.token, digest) and not one.disabled:
            found = login, one
    return found


def by_passkey(people: People, credential: str) -> tuple[str, Person, Passkey] | None:
    """Login and entry of the person with a passkey of this id, and the passkey; None if there is none."""
    for login, one in people.people.items():
        for passkey in one.passkeys.values():
            if passkey.id == credential and not one.disabled:
                return login, one, passkey
    return None


def check_role(login: str, person: Person, role: str) -> None:
    """Raises `UsageError` if a person has not got this role; everybody has the role ""."""
    if role and role not in person.roles:
        raise UsageError(f"{person.name} ({login}) is {', '.join(person.roles)}, and this needs the role {role}")


def proven(login: str, person: Person, by: Literal["password", "passkey"] = "password") -> Operator:
    """A person whose password was right, or whose passkey signed, for records."""
    return Operator(f"{person.name} ({login})", by)


def new_password() -> str:
    """A first password, to be told to a person, who changes it."""
    return "-".join("".join(secrets.choice(_READABLE) for _ in range(5)) for _ in range(4))


def as_roles(text: str) -> list[str]:
    """Roles from a text with commas or blanks."""
    return [one for one in re.split(r"[\s,]+", text) if one]


_NOBODY: list[str] = []


def _nobody() -> str:
    if not _NOBODY:
        _NOBODY.append(_hasher().hash(secrets.token_hex()))
    return _NOBODY[0]


def _hasher() -> Any:
    return needed("argon2", "serve").PasswordHasher(**COST)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()
