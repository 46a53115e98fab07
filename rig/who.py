"""The operator of a session: a given name, or the login name, for the run file."""

from __future__ import annotations

import os
import pwd
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from rig.errors import UsageError

VARIABLE: Literal["RIG_OPERATOR"] = "RIG_OPERATOR"
"""Environment variable with the operator's name, if the command line has none."""
BY_PASSWORD: Literal["RIG_OPERATOR_BY"] = "RIG_OPERATOR_BY"
"""Environment variable with which `rig serve` says of the name in `VARIABLE` what proved it, one of `PROVEN`."""
PROVEN: tuple[Literal["password", "passkey"], ...] = ("password", "passkey")
"""Sources of a name that prove it is that person's."""
_LONGEST = 115
"""A name of 80 characters in `people.toml`, with a login of 32 behind it, is such a name too."""


@dataclass(frozen=True)
class Operator:
    """The operator of a session.

    Attributes:
        name: name of the person, or of the account.
        by: source of the name; verified only by "password" or "passkey", or the "token" of a program.
    """

    name: str
    by: Literal["--operator", "RIG_OPERATOR", "login", "password", "passkey", "token"]

    def as_json(self) -> dict[str, str]:
        """Values for the run file."""
        return {"operator": self.name, "operator_by": self.by}


def operator(given: str | None = None) -> Operator:
    """The operator of this session: as given, or from `RIG_OPERATOR`, or the login name of this process.

    Raises:
        UsageError: the name is empty, too long, or has unprintable characters.
    """
    if given is not None:
        return Operator(_checked(given, "--operator"), "--operator")
    if os.environ.get(VARIABLE):
        given_by = os.environ.get(BY_PASSWORD)
        by = next((one for one in PROVEN if one == given_by), VARIABLE)
        return Operator(_checked(os.environ[VARIABLE], VARIABLE), by)
    try:
        return Operator(pwd.getpwuid(os.getuid()).pw_name, "login")
    except KeyError:
        return Operator(f"uid {os.getuid()}", "login")


def login_of(who: str) -> str:
    """The login in the name of a person of a laboratory, "Anna Berg (anna)"; the whole name if there is none."""
    return who[:-1].rpartition("(")[2] if who.endswith(")") else who


def _checked(name: str, where: str) -> str:
    name = name.strip()
    if not name or len(name) > _LONGEST or not name.isprintable():
        raise UsageError(f"{where} {name!r:.120}: a name has 1 to {_LONGEST} printable characters")
    return name


def told(about: Mapping[str, Any]) -> str:
    """The operator named by the first record or a session's record, for people; "" if there is none."""
    name = str(about.get("operator") or "")
    return f"{name} (login name)" if name and about.get("operator_by") == "login" else name
