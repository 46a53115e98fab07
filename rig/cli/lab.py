"""`rig lab`: what is due, the history of an item, and what a wrong piece of equipment affects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from datetime import UTC, date, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import DatabaseOption, JsonOption
from rig.cli.show import err, out, print_json
from rig.cli.waiting import waiting
from rig.drivers.clock import RealClock
from rig.errors import ConfigurationError, ExitCode, UsageError
from rig.fitter.rounding import with_error
from rig.procedures.present.blocks import Block, Grid, Line
from rig.procedures.present.terminal import show

if TYPE_CHECKING:
    from rig.archive import Affected, Due, History, Lab


SOON = 30
"""Days before a date from which it is marked."""


class Question(StrEnum):
    """Questions to a laboratory's files."""

    DUE = "due"
    ITEM = "item"
    RECALL = "recall"


@app.command()
def lab(
    question: Annotated[
        Question, typer.Argument(help="due: what is due; item: its history; recall: certificates that rest on it")
    ] = Question.DUE,
    name: Annotated[
        str, typer.Argument(help="item, recall: its asset or serial number, or a certificate's", show_default=False)
    ] = "",
    folder: Annotated[Path, typer.Option(help="folder of the laboratory, with all below it")] = Path(),
    within: Annotated[int | None, typer.Option(help="due: only within so many days", show_default="all")] = None,
    since: Annotated[str, typer.Option(help="recall: wrong since this date, as 2026-03-01", show_default="ever")] = "",
    until: Annotated[str, typer.Option(help="recall: until this date", show_default="now")] = "",
    today: Annotated[str, typer.Option(help="due: the date from which days count", show_default="today")] = "",
    check: Annotated[bool, typer.Option("--check", help="due: exit code 3 if something is overdue")] = False,
    remind: Annotated[
        bool, typer.Option("--remind", help="due: send what is due within 30 days over the channels of notify.toml")
    ] = False,
    rebuild: Annotated[bool, typer.Option("--rebuild", help="read every file again, also unchanged ones")] = False,
    database: DatabaseOption = "",
    as_json: JsonOption = False,
) -> int:
    """Say what is due in a laboratory, the history of an item, or which certificates rest on a piece of equipment.

    It reads certificates (their JSON) and registers (equipment.toml) in a folder and all below it. An item is due by
    the date that its certificate states, and on the day on which its drift and uncertainty may break its tolerance.

    Examples:

    - `rig lab`
    - `rig lab due --within 30 --check`
    - `rig lab item S-1042`
    - `rig lab recall DVM-0207 --since 2026-03-01`
    """
    from rig import archive as answers  # noqa: PLC0415 - statistics take a while to import

    if (question is Question.DUE) == bool(name):
        raise UsageError(
            f"`rig lab due` is of everything: leave {name!r} out"
            if name
            else f"{question} of what? `rig lab item ASSET`, `rig lab recall ASSET`, or a serial or certificate number"
        )
    now = _day(today, "--today") or datetime.fromtimestamp(RealClock().utc(), UTC).date()
    with ExitStack() as opened:
        with waiting("reading certificates"):
            index = opened.enter_context(answers.Lab.open(folder, rebuild=rebuild, database=database))
        problems = index.problems()
        match question:
            case Question.DUE:
                told: Any = [
                    one for one in answers.due(index) if within is None or (one.on and _days(one, now) <= within)
                ]
                blocks = _due(told, now, index)
            case Question.ITEM:
                told = answers.history(index, name)
                blocks = _history(told, now)
            case Question.RECALL:
                told = answers.affected(index, name, _day(since, "--since"), _day(until, "--until"))
                blocks = _recall(told, name, since, until)
        if as_json:
            print_json({"answer": _plain(told, now), "problems": problems})
        else:
            show(blocks, out)
    if not as_json:
        for problem in problems:
            err.print(f"[yellow]{escape(problem)}[/]")
    if remind and question is Question.DUE:
        _remind([one for one in told if one.on and _days(one, now) <= SOON], now, folder)
    overdue = question is Question.DUE and any(
        one.on and not one.only_known_until and _days(one, now) < 0 for one in told
    )
    return ExitCode.OUTSIDE_ACCEPTANCE if check and overdue else ExitCode.DONE


def _day(given: str, option: str) -> date | None:
    try:
        return date.fromisoformat(given) if given else None
    except ValueError:
        raise UsageError(f"{option}: {given!r} is not a date; write 2026-01-15") from None


def _days(one: Due, now: date) -> int:
    return (date.fromisoformat(one.on) - now).days


def _plain(told: Any, now: date) -> Any:
    if isinstance(told, list):
        return [_plain(one, now) for one in told]
    found = asdict(told)
    if hasattr(told, "only_known_until"):
        found |= {"on": told.on, "only_known_until": told.only_known_until}
        found["days"] = _days(told, now) if told.on else None
    return found


def _due(rows: Sequence[Due], now: date, index: Lab) -> Iterator[Block]:
    if not rows:
        yield Line(f"nothing is due in {escape(str(index.folder))}, as far as its files say")
        return
    grid = Grid(("due", "days", "what", "last calibration", "by"))
    for one in rows:
        days = _days(one, now) if one.on else None
        late = days is not None and days < 0 and not one.only_known_until
        mark = "red" if late else "yellow" if days is not None and days < SOON else "default"
        when = one.on or "not known"
        last = f"{one.certificate} of {one.dated}" if one.certificate else "none"
        grid.add_row(
            f"[{mark}]{f'after {when}' if one.only_known_until else when}[/]",
            "" if days is None else str(days),
            escape(_called(one)),
            escape(f"SIMULATED {last}" if one.simulated else last),
            escape(one.by),
        )
    yield grid


def _remind(soon: Sequence[Due], now: date, folder: Path) -> None:
    """Send what is due over every channel. Raises `ConfigurationError`, or `UsageError` if a channel fails."""
    from rig.unattended.happenings import Kind  # noqa: PLC0415
    from rig.unattended.notify.channels import senders  # noqa: PLC0415 - mail and web take a while
    from rig.unattended.notify.delivery import NotSent  # noqa: PLC0415
    from rig.unattended.notify.message import HEADLINES, Message, when  # noqa: PLC0415
    from rig.unattended.notify.notify_file import read_settings  # noqa: PLC0415
    from rig.unattended.place_of_notify import find_settings  # noqa: PLC0415

    path = find_settings(None)
    if path is None:
        raise ConfigurationError("--remind: there is no notify.toml; docs/how_to/unattended.md shows one")
    if not soon:
        return
    sends, wrong = senders(read_settings(path), str(path))
    lines = [f"{_called(one)}: {one.on}, in {_days(one, now)} days; by {one.by}" for one in soon]
    message = Message(
        Kind.DUE,
        f"{len(soon)} {HEADLINES[Kind.DUE]} within {SOON} days",
        "; ".join(lines),
        where=f"files in {folder.absolute()}",
        when=when(RealClock().utc()),
        progress="",
        next_step="rig lab",
        run="",
    )
    for label, send in sends.items():
        try:
            send(message)
        except NotSent as error:
            wrong.append(f"{label}: {error}")
    if wrong:
        raise UsageError(f"not everybody was reminded: {'; '.join(wrong)}")


def _called(one: Due) -> str:
    """Number, name and owner of a thing."""
    thing = one.thing
    number = thing.asset or thing.serial
    what = " ".join(filter(None, (number, thing.name if number != thing.name else "", thing.model)))
    return f"{what} ({one.customer})" if one.customer else what


def _history(told: History, now: date) -> Iterator[Block]:
    thing = told.thing
    yield Line(
        f"[bold]{escape(' '.join(filter(None, (thing.name, thing.maker, thing.model, thing.serial, thing.asset))))}[/]"
    )
    if not (thing.serial or thing.asset):
        yield Line("  [yellow]known by its name alone: state its serial number in the register[/]")
    grid = Grid(("calibrated", "certificate", "customer", "values with tolerances"))
    for row, values in zip(told.certificates, told.values, strict=True):
        shown = [
            f"{one['what']}{' as left' if one['left'] else ''}: "
            f"{' +- '.join(with_error(one['value'], one['standard']))} {one['unit']}"
            for one in values
        ]
        number = f"SIMULATED {row['number']}" if row["simulated"] else row["number"]
        grid.add_row(row["ended"], escape(number), escape(row["customer"]), escape("\n".join(shown) or "none"))
    yield grid
    yield Line("  values +- one standard uncertainty")
    one = told.due
    if one is not None:
        drift = f"by its drift: {one.drift.words}" if one.drift.on else one.drift.why
        yield Line(f"  due by its cycle: {one.cycle or 'none stated'}; {escape(drift)}")


def _recall(told: Sequence[Affected], name: str, since: str, until: str) -> Iterator[Block]:
    time = " ".join(filter(None, (f"since {since}" if since else "", f"until {until}" if until else "")))
    if not told:
        yield Line(f"no certificate rests on {escape(name)}{f' {time}' if time else ''}")
        return
    count = "1 certificate[/] rests" if len(told) == 1 else f"{len(told)} certificates[/] rest"
    yield Line(f"[bold]{count} on {escape(' '.join(filter(None, (name, time))))}")
    grid = Grid(("calibrated", "certificate", "customer", "items", "through"))
    for one in told:
        number = f"{one.number}, replaced by {one.replaced_by}" if one.replaced_by else one.number
        grid.add_row(
            one.ended,
            escape(f"SIMULATED {number}" if one.simulated else number),
            escape(one.customer),
            escape(", ".join(one.items)),
            escape(" > ".join(one.through)),
        )
    yield grid
