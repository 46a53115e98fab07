"""`rig instrument`: declared instruments."""

from __future__ import annotations

import signal
import tomllib
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Column, Table

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, mark, out, print_json
from rig.errors import ExitCode, UsageError
from rig.files.atomic import write_whole
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import print_whole


class Action(StrEnum):
    """An action on instruments."""

    LIST = "list"
    SHOW = "show"
    CHECK = "check"
    NEW = "new"
    SCAN = "scan"


@app.command()
def instrument(
    action: Annotated[Action, typer.Argument(help="list, show NAME, check FILE, new FILE, scan ADDRESS")],
    names: Annotated[
        list[str] | None, typer.Argument(help="driver name or file; of scan, addresses", show_default=False)
    ] = None,
    address: Annotated[str, typer.Option(help="check: the real instrument; else its twin", show_default=False)] = "",
    option: Annotated[
        list[str] | None,
        typer.Option(help="check: an option as in a bench file, `node = 3`; repeatable", show_default=False),
    ] = None,
    set_: Annotated[
        float | None,
        typer.Option("--set", help="check: prepare it, set this value, then make it safe", show_default=False),
    ] = None,
    prepare: Annotated[
        bool, typer.Option("--prepare", help="check: prepare it, so that units and ranges are those of the file")
    ] = False,
    wait: Annotated[float, typer.Option(min=0, help="check: longest wait until it has settled, seconds")] = 3600.0,
    report: Annotated[Path | None, typer.Option(help="check: write a report (Markdown)", show_default=False)] = None,
    as_json: JsonOption = False,
) -> int:
    """List, show, check, begin or look for instruments that are tables: `driver = "./my_bath.toml"`.

    `check` sends only questions, and what chooses a channel, unless it is told to prepare it or to set a value. `new`
    asks what the manual says, and writes a commented file. `scan` asks at the named addresses who is there, and nothing
    else. Ends with 1 if an instrument is not as its file says, with 78 if a file is wrong.

    Examples:

    - `rig instrument list`
    - `rig instrument show julabo-fp50`
    - `rig instrument check my_bath.toml --address /dev/ttyUSB0`
    """
    given = names or []
    if action is not Action.LIST and not given:
        what = "an address" if action is Action.SCAN else "a name or a file"
        raise UsageError(f"{action} needs {what}: `rig instrument --help`")
    match action:
        case Action.LIST:
            return _list(as_json=as_json)
        case Action.SHOW:
            return _show(given)
        case Action.NEW:
            return _new(Path(given[0]))
        case Action.SCAN:
            return _scan(given, as_json=as_json)
    return _check(given, address, _options(option or []), set_, wait, report, prepare=prepare, as_json=as_json)


def _list(*, as_json: bool) -> int:
    from rig.verbs.instrument.catalogue import listed  # noqa: PLC0415

    rows = listed()
    if as_json:
        print_json(rows)
        return ExitCode.DONE
    # A line each, whatever the width: `show` prints all of it.
    what = Column("is", no_wrap=True, ratio=1)
    table = Table("driver", what, "roles", "wire", "tried", box=None, pad_edge=False, expand=True)
    for row in rows:
        table.add_row(*(escape(one) for one in row.values()))
    out.print(table)
    return ExitCode.DONE


def _show(names: list[str]) -> int:
    from rig.verbs.instrument.catalogue import page  # noqa: PLC0415

    for name in names:
        print(page(name), end="")
    return ExitCode.DONE


def _new(path: Path) -> int:
    from rig.bench.contract_files import with_hook  # noqa: PLC0415
    from rig.errors import ConfigurationError  # noqa: PLC0415
    from rig.verbs.instrument.new import asked, lacking  # noqa: PLC0415

    if path.exists():
        raise UsageError(f"{path} exists; name another file")
    text = asked(lambda question, assumed: str(typer.prompt(question, default=assumed, err=True)))
    write_whole(path, lambda file: file.write(text))
    try:
        said = lacking(with_hook(text, path))
    except ConfigurationError as error:  # its DBC is not there yet
        said = str(error)
    if said:
        err.print(f"{escape(str(path))} is written; it still lacks: {escape(said)}")
    else:
        err.print(f"{escape(str(path))} is written; next: rig instrument check {escape(shell_word(path))}")
    return ExitCode.DONE


def _scan(addresses: list[str], *, as_json: bool) -> int:
    from rig.drivers.clock import RealClock  # noqa: PLC0415
    from rig.drivers.errors import DriverError, NoReply  # noqa: PLC0415
    from rig.verbs.instrument.scan import scan  # noqa: PLC0415

    found: list[dict[str, str]] = []
    heard = False
    for address in addresses:
        try:
            for driver, who in scan(address, RealClock()):
                found.append({"address": address, "driver": driver, "is": who})
                if not as_json:
                    out.print(escape(f"{address}: {driver}: {who}"))
            heard = True
        except NoReply as silent:
            err.print(escape(str(silent)), soft_wrap=True)
        except DriverError as error:
            raise UsageError(str(error)) from error
    if as_json:
        print_json(found)
    elif heard and not found:
        err.print("nobody answers who is known; `rig instrument new FILE` describes another instrument")
    return ExitCode.DONE if found else ExitCode.FAULT


def _options(given: list[str]) -> dict[str, Any]:
    try:
        return tomllib.loads("\n".join(given))
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"--option is written as in a bench file, `node = 3`: {error}") from None


def _check(
    names: list[str],
    address: str,
    options: dict[str, Any],
    setpoint: float | None,
    wait: float,
    report: Path | None,
    *,
    prepare: bool,
    as_json: bool,
) -> int:
    from rig.verbs.instrument.catalogue import text_named  # noqa: PLC0415
    from rig.verbs.instrument.check import check  # noqa: PLC0415

    if address and len(names) > 1:
        raise UsageError("one address is one instrument: name one file")
    if address and setpoint is not None:  # however it is ended, the instrument is left in its safe state
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.default_int_handler)
    found = [check(*text_named(name), address, options, setpoint, wait, prepare=prepare) for name in names]
    if report is not None:
        pages = "\n".join(one.report() for one in found)
        write_whole(report, lambda file: file.write(pages))
    if as_json:
        print_json([one.as_json() for one in found])
    else:
        for one in found:
            table = Table(
                "", "step", "found", box=None, pad_edge=False, title=escape(f"{one.instrument} ({one.address})")
            )
            for step in one.steps:
                style = {"ok": "green", "DIFFERS": "yellow", "WRONG": "bold red"}[step.word]
                wire = "".join(f"\n[dim]{escape(line)}[/]" for line in step.wire)
                table.add_row(f"[{style}]{step.word}[/]", step.what, escape(step.found) + wire)
            print_whole(table, out)
        for verdict in dict.fromkeys(one.verdict for one in sorted(found, key=lambda one: one.ok)):
            err.print(f"{mark(not address)}{verdict}")
    return ExitCode.DONE if all(one.ok for one in found) else ExitCode.FAULT
