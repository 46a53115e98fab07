"""`rig serve`, `rig act`: the server of a laboratory, and any of its acts from the command line."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import DatabaseOption, JsonOption
from rig.cli.people import LabOption
from rig.cli.show import err, out, print_json
from rig.cli.signed_in import LoginOption, asked_password, signed_in
from rig.errors import ExitCode, UsageError
from rig.lab import laboratory_in


@app.command()
def serve(
    lab: Annotated[Path, typer.Argument(help="a folder of the laboratory")] = Path(),
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0 for any free port")] = 8322,
    host: Annotated[str, typer.Option(help="address to listen on; other than this machine's own needs TLS")] = (
        "127.0.0.1"
    ),
    name: Annotated[
        list[str] | None, typer.Option(help="host name by which browsers reach it; repeatable", show_default=False)
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option(help="TLS certificate with its chain, PEM", show_default=False)
    ] = None,
    key: Annotated[Path | None, typer.Option(help="private key of the certificate, PEM", show_default=False)] = None,
    queue: Annotated[bool, typer.Option("--queue/--no-queue", help="carry out the queue of the laboratory")] = True,
    database: DatabaseOption = "",
) -> int:
    """Serve a laboratory: benches, queue, runs, proposals, results, and acts of people who are logged in.

    People are those of `rig person`. The first line printed is the address to open. Runs that were started go on after
    its end. The same acts are a JSON API for programs with a token (`docs/how_to/people_and_server.md`).

    Examples:

    - `rig serve`
    - `rig serve /srv/laboratory --port 8443`
    - `rig serve --host 0.0.0.0 --name rig.lab --certificate lab.pem --key lab.key`
    """
    laboratory = replace(laboratory_in(lab), database=database)
    from rig.serve import serve as serve_laboratory  # noqa: PLC0415 - the web server is slow to import

    serve_laboratory(
        laboratory,
        host=host,
        port=port,
        names=frozenset(one.lower() for one in name or ()),
        certificate=certificate,
        key=key,
        works=queue,
        announce=lambda text: print(text, flush=True),
        said=lambda words: err.print(escape(words), soft_wrap=True),
    )
    return ExitCode.DONE


@app.command()
def mcp(lab: Annotated[Path, typer.Argument(help="a folder of the laboratory")] = Path()) -> int:
    """Let a language model see a laboratory and propose runs, by the Model Context Protocol.

    It speaks on standard input and output, and acts as the program whose token is in `RIG_TOKEN`. It reads, and
    proposes runs for a person to decide; it starts, answers and approves nothing. It needs the extra `mcp`.

    Examples:

    - `rig mcp`
    - `rig mcp .`
    - `rig mcp /srv/laboratory`
    """
    from rig.serve.mcp import serve_mcp  # noqa: PLC0415 - few call it

    serve_mcp(laboratory_in(lab), os.environ.get("RIG_TOKEN", ""))
    return ExitCode.DONE


@app.command()
def act(
    name: Annotated[str, typer.Argument(help="the act; without one, all are listed", show_default=False)] = "",
    values: Annotated[list[str] | None, typer.Argument(help="its values, as NAME=VALUE", show_default=False)] = None,
    login: LoginOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="confirm that what moves may move")] = False,
    lab: LabOption = Path(),
    as_json: JsonOption = False,
) -> int:
    """Do in a laboratory what its pages do, as a person with a password.

    Examples:

    - `rig act`
    - `rig act pause why="a visitor" --login anna`
    - `rig act start proposal=3 --login anna --yes`
    """
    from rig.acts import Places, act_of, acts  # noqa: PLC0415
    from rig.acts.act import SECRET, of_field  # noqa: PLC0415

    if not name:
        for one in acts():
            fields = " ".join(f"{field}=..." for field in one.model_fields)
            needs = f"{one.role or 'everybody'}{', confirmed' if one.moves else ''}"
            out.print(f"[bold]{one.name}[/] {escape(fields)}  [dim]{escape(one.does())} ({needs})[/]", soft_wrap=True)
        return ExitCode.DONE
    laboratory = laboratory_in(lab)
    given = dict(one.partition("=")[::2] for one in values or ())
    known = [one for one in acts() if one.name == name]
    for field in (field for one in known for field in one.model_fields if SECRET in of_field(one, field)):
        if field not in given:  # passwords stay out of the history of a shell
            given[field] = asked_password(field.replace("_", " ").capitalize(), new=True)
    asked, places = act_of(name, given), Places(laboratory)
    by = signed_in(laboratory, login, asked.role)
    if asked.moves:
        will = asked.will(places)
        if not yes:
            raise UsageError(f"{will} Confirm it with --yes")
    told = asked.carry_out(places, by)
    if as_json:
        print_json({"said": told.words, **told.about})
    else:
        out.print(escape(told.words), soft_wrap=True)
    return ExitCode.DONE
