"""Passwords on the command line: from the terminal without an echo, or a line of standard input each."""

from __future__ import annotations

import contextlib
import sys
from typing import Annotated

import typer

from rig.errors import RigError, UsageError
from rig.lab import Laboratory, by_password, check_role, proven
from rig.who import Operator, operator

LoginOption = Annotated[
    str | None,
    typer.Option("--login", help="who you are, in people.toml; your password is asked for", show_default=False),
]


def asked_password(words: str, *, new: bool = False) -> str:
    """A password; a new one is asked for twice at a terminal. Raises `UsageError` if there is no line for it."""
    if sys.stdin.isatty():
        return str(typer.prompt(words, hide_input=True, confirmation_prompt=new, err=True))
    line = sys.stdin.readline()
    if not line:
        raise UsageError(f"{words}: standard input has no line for it")
    return line.rstrip("\r\n")


def signed_in(laboratory: Laboratory, login: str | None, role: str) -> Operator:
    """The person with this login, once the password was right, and the role is one of theirs. Raises `UsageError`.

    The log has `people.toml` as it is used here, even if an editor restores it later.
    """
    with contextlib.suppress(RigError, OSError):  # a hold works on a full disk too; a decision is written anyway
        laboratory.note_changes(operator())
    people = laboratory.people()
    if login is None:
        able = ", ".join(people.having(role) if role else people.people) or "nobody yet"
        whom = f"with the role {role}" if role else "who is known"
        raise UsageError(f"this needs a person {whom}: --login LOGIN ({able}), and the password")
    person = by_password(people, login, asked_password(f"Password of {login}"))
    check_role(login, person, role)
    return proven(login, person)
