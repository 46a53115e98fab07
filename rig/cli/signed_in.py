"""Passwords on the command line: from the terminal without an echo, or a line of standard input each."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.errors import RigError, UsageError
from rig.lab import Laboratory, by_password, check_role, laboratory_of, proven
from rig.who import PROVEN, Operator, login_of, operator

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


def acting(where: Path, login: str | None, name: str | None = None, *, refuses: bool = True) -> Operator:
    """Who acts on a run or bench, as honestly as a page says it.

    Args:
        where: the run file, or the bench file.
        login: login of a person of its laboratory, whose password is asked for; None without.
        name: the operator's name, as given.
        refuses: whether the unproven name of a person is refused; a hold or a stop is not, and says so instead.

    Raises:
        UsageError: the password is wrong, the role operator is missing, or the name is that of a person of the
            laboratory, which nothing proves.
    """
    laboratory = laboratory_of(where)
    if login is not None:
        if laboratory is None:
            raise UsageError(f"{where} is in no laboratory with people: --operator NAME, or rig person")
        return signed_in(laboratory, login, "operator")
    by = operator(name)
    if laboratory is None or by.by in PROVEN:
        return by
    try:
        people = laboratory.people().people
    except RigError:
        return by  # who keeps the file mends it; a run goes on
    own = login_of(by.name)
    if own == by.name or own not in people:
        return by
    if refuses:
        raise UsageError(f"{by.name} is a person of this laboratory: --login {own} proves it, with the password")
    return Operator(f"{by.name}, not proven", by.by)
