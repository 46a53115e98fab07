"""Who runs a session: what people say, or else the login name, for the run file."""

from __future__ import annotations

import os
import pwd
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from rig.errors import UsageError

VARIABLE: Literal["RIG_OPERATOR"] = "RIG_OPERATOR"
"""Environment variable with the operator's name, where the command line does not say."""
_LONGEST = 100


@dataclass(frozen=True)
class Operator:
    """Who runs a session. Nobody checks it: it is what was said, or under which account the program ran.

    Attributes:
        name: of the person, or of the account.
        by: how it is known.

    """

    name: str
    by: Literal["--operator", "RIG_OPERATOR", "login"]

    def as_json(self) -> dict[str, str]:
        """For the run file."""
        return {"operator": self.name, "operator_by": self.by}


def operator(given: str | None = None) -> Operator:
    """Who runs this session: as given, else as `RIG_OPERATOR` has it, else the login name of this process.

    Raises:
        UsageError: the name is empty, too long, or has characters that are not printed.

    """
    if given is not None:
        return Operator(_checked(given, "--operator"), "--operator")
    if os.environ.get(VARIABLE):
        return Operator(_checked(os.environ[VARIABLE], VARIABLE), VARIABLE)
    try:
        return Operator(pwd.getpwuid(os.getuid()).pw_name, "login")
    except KeyError:
        return Operator(f"uid {os.getuid()}", "login")


def _checked(name: str, where: str) -> str:
    name = name.strip()
    if not name or len(name) > _LONGEST or not name.isprintable():
        raise UsageError(f"{where} {name!r:.120}: a name has 1 to {_LONGEST} printable characters")
    return name


def told(about: Mapping[str, Any]) -> str:
    """The operator that a first record or a session's record names, for people; "" if it names none."""
    name = str(about.get("operator") or "")
    return f"{name} (login name)" if name and about.get("operator_by") == "login" else name
