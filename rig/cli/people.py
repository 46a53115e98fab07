"""`rig person`, `rig log`: people of a laboratory, and changes of its files."""

from __future__ import annotations

from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, out, print_json
from rig.cli.signed_in import LoginOption, asked_password, signed_in
from rig.errors import ExitCode, UsageError
from rig.lab import Laboratory, differences, laboratory_in, laboratory_of
from rig.lab.people import ROLES, check_login, hashed, new_token
from rig.procedures.present.blocks import Grid
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import show
from rig.procedures.present.visible import visible_line
from rig.run_file.events.sessions import RunCreated
from rig.run_file.verify.verification import verify_file
from rig.who import Operator, operator

LabOption = Annotated[Path, typer.Option("--lab", help="a folder of the laboratory")]


class Action(StrEnum):
    """Things to do with people."""

    ADD = "add"
    LIST = "list"
    REMOVE = "remove"
    PASSWORD = "password"


@app.command()
def person(
    action: Annotated[Action, typer.Argument(help="what to do", show_default=False)],
    who: Annotated[str, typer.Argument(help="login of the person, such as anna", show_default=False)] = "",
    name: Annotated[str, typer.Option(help="add: the name, for people and run files", show_default=False)] = "",
    roles: Annotated[str, typer.Option(help="add: one or more, with commas: " + ", ".join(ROLES))] = "operator",
    program: Annotated[
        bool, typer.Option("--program", help="add: a program, with a token that is printed once, and no password")
    ] = False,
    login: LoginOption = None,
    lab: LabOption = Path(),
    as_json: JsonOption = False,
) -> int:
    """People of a laboratory: who they are, what they may do, and their passwords.

    They are in `people.toml` of the laboratory's folder, with argon2id hashes of their passwords, and every change is
    in `log.sqlite` beside it. Once there is an administrator, only an administrator changes them (--login); everybody
    changes the own password. Passwords are asked for at the terminal, or are lines of standard input.

    Examples:

    - `rig person add anna --name "Anna Berg" --roles operator,administrator`
    - `rig person list`
    - `rig person password anna --login anna`
    """
    laboratory = laboratory_of(lab) or Laboratory(lab.absolute())
    if action is Action.LIST:
        return _list(laboratory_in(lab), as_json=as_json)
    check_login(who)
    by = _allowed(laboratory, action, who, login)
    told = ""
    if action is Action.REMOVE:
        laboratory.change_people(
            lambda people: people.pop(_known(people, who)), f"rig person remove {shell_word(who)}", by
        )
    elif action is Action.PASSWORD:
        _known(_tables(laboratory), who)
        new = hashed(asked_password(f"New password of {who}", new=True))
        laboratory.change_people(
            lambda people: people[who].update(password=new), f"rig person password {shell_word(who)}", by
        )
    else:
        if who in _tables(laboratory):
            raise UsageError(f"{who} is there already: rig person password, or rig person remove")
        if not name:
            raise UsageError('who is that? --name "First Last"')
        secret: dict[str, str] = {}
        if program:
            told, secret["token"] = new_token()
        else:
            secret["password"] = hashed(asked_password(f"New password of {who}", new=True))
        new_person = {"name": name, "roles": [one.strip() for one in roles.split(",")], **secret}
        laboratory.change_people(
            lambda people: people.update({who: new_person}), f"rig person add {shell_word(who)}", by
        )
    err.print(f"{escape(str(laboratory.people_file))}: {action} {who}", soft_wrap=True)
    if told:
        print(told)
        err.print("this is its token, once: the file has only the SHA-256")
    return ExitCode.DONE


def _tables(laboratory: Laboratory) -> dict[str, Any]:
    return dict(laboratory.people().people) if laboratory.people_file.exists() else {}


def _known(people: dict[str, Any], who: str) -> str:
    if who not in people:
        raise UsageError(f"there is nobody with the login {who} (known: {', '.join(sorted(people)) or 'nobody'})")
    return who


def _allowed(laboratory: Laboratory, action: Action, who: str, login: str | None) -> Operator:
    """Who changes the people: an administrator, once there is one; for the own password, the person."""
    if not laboratory.people_file.exists() or not laboratory.people().having("administrator"):
        return operator()
    if action is Action.PASSWORD and login == who:
        own = laboratory.people().people.get(who)
        return signed_in(laboratory, login, own.roles[0] if own is not None else "administrator")
    return signed_in(laboratory, login, "administrator")


def _list(laboratory: Laboratory, *, as_json: bool) -> int:
    people = laboratory.people().people
    if as_json:
        rows = {
            login: {"name": one.name, "roles": one.roles, "program": bool(one.token), "disabled": one.disabled}
            for login, one in people.items()
        }
        print_json(rows)
        return ExitCode.DONE
    table = Grid(("login", "name", "roles", "signs in by"), frame="plain", apart=2)
    for login, one in people.items():
        means = "password" if one.password else "token" if one.token else "nothing: rig person password"
        means = "disabled" if one.disabled else f"{means}, passkey" if one.passkeys else means
        table.add_row(login, escape(one.name), ", ".join(one.roles), means)
    show((table,), out)
    return ExitCode.DONE


@app.command()
def log(
    lab: Annotated[Path, typer.Argument(help="a folder of the laboratory")] = Path(),
    as_json: JsonOption = False,
) -> int:
    """Changes of people, equipment and settings of a laboratory: who, when, what before, what after.

    The log is append-only and chained like a run file. It has every file `*.toml` of the laboratory, without passwords.
    A change by an editor is found and written by the next command of the laboratory. Exit code 1: the log was changed.

    Examples:

    - `rig log`
    - `rig log /srv/laboratory`
    - `rig log --json`
    """
    laboratory = laboratory_in(lab)
    laboratory.note_changes(operator())
    found = verify_file(laboratory.log_file)
    whole = laboratory.verified_log()
    if beyond := laboratory.beyond():
        err.print(f"[yellow]{beyond} files *.toml are not in it: there are too many of them in {escape(str(lab))}[/]")
    rows = [row for row in differences(whole) if not isinstance(row[0].event, RunCreated)]
    if as_json:
        events = [
            {"utc_s": record.utc_s, "status": record.status, "says": record.sentence(), **record.data, "lines": lines}
            for record, lines in rows
        ]
        print_json({"file": str(laboratory.log_file), "head": found.head, "records": events})
        return ExitCode.DONE
    for record, lines in rows:
        moment = datetime.fromtimestamp(record.utc_s, UTC)
        out.print(f"[bold]{moment:%Y-%m-%d %H:%M} UTC[/]  {escape(visible_line(record.sentence()))}", soft_wrap=True)
        for line in lines[:_MOST_LINES]:
            colour = "red" if line.startswith("-") else "green"
            out.print(f"  [{colour}]{escape(line)}[/]", soft_wrap=True, highlight=False)
        if len(lines) > _MOST_LINES:
            out.print(f"  and {len(lines) - _MOST_LINES} lines more: --json has all")
    out.print(f"{found.records} records, chain unbroken, head {found.head}", soft_wrap=True, highlight=False)
    return ExitCode.DONE


_MOST_LINES = 12
