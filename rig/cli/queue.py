"""`rig queue`: runs and loops one after the other on a bench, several benches at once."""

from __future__ import annotations

from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, out, print_json
from rig.cli.signals import signals
from rig.drivers.clock import RealClock
from rig.errors import ExitCode, UsageError
from rig.procedures.present.blocks import Grid
from rig.procedures.present.terminal import show
from rig.who import operator

if TYPE_CHECKING:
    from rig.queue import Item, Keeps, Queue


class Action(StrEnum):
    """Things to do with a queue."""

    ADD = "add"
    LIST = "list"
    MOVE = "move"
    REMOVE = "remove"
    RUN = "run"
    PAUSE = "pause"


class Then(StrEnum):
    """Policy after a fault, or outside acceptance."""

    GO_ON = "go on"
    HOLD = "hold"
    STOP = "stop"


@app.command()
def queue(
    action: Annotated[Action, typer.Argument(help="what to do", show_default=False)],
    what: Annotated[
        str, typer.Argument(help="add: the procedure file; move, remove: number of an item", show_default=False)
    ] = "",
    bench: Annotated[Path | None, typer.Option("--bench", "-b", help="add: the bench file", show_default=False)] = None,
    loop: Annotated[bool, typer.Option("--loop", help="add: as a loop instead of a single run")] = False,
    until: Annotated[str | None, typer.Option(help="add --loop: end of the loop", show_default=False)] = None,
    hours: Annotated[float | None, typer.Option(help="add --loop: the same in hours", show_default=False)] = None,
    dry: Annotated[bool, typer.Option("--dry", help="add: on simulated instruments")] = False,
    world: Annotated[Path | None, typer.Option(help="add --dry: the world file", show_default=False)] = None,
    not_before: Annotated[
        str, typer.Option(help="add: begins at this local time or later, as 2026-01-15T18:00", show_default=False)
    ] = "",
    needs: Annotated[
        list[str] | None, typer.Option(help="add: something that has to be there, in words; repeatable")
    ] = None,
    priority: Annotated[int, typer.Option(help="add, move: a larger one comes first")] = 0,
    then: Annotated[
        Then, typer.Option(help="add: the next items of its bench after a fault or outside acceptance")
    ] = Then.HOLD,
    has: Annotated[
        list[str] | None, typer.Option(help="run: something that is there, as in --needs; repeatable")
    ] = None,
    stay: Annotated[bool, typer.Option("--stay", help="run: wait for further items at the end")] = False,
    off: Annotated[bool, typer.Option("--off", help="pause: go on, and forget holds of benches")] = False,
    file: Annotated[Path, typer.Option("--queue", help="file of the queue")] = Path("runs/queue.sqlite"),
    database: Annotated[
        str,
        typer.Option(
            envvar="RIG_DATABASE", help="a queue that machines share, as postgresql://rig@db/lab", show_envvar=True
        ),
    ] = "",
    machine: Annotated[
        str, typer.Option(help="--database: the machine whose items are meant; this one by its name")
    ] = "",
    as_json: JsonOption = False,
) -> int:
    """Carry out runs and loops one after the other on a bench, several benches at once.

    `run` carries out the items, each in a process and a folder of its own; after a crash, `run` again goes on. `pause`
    lets the present items end and begins no others. Exit code of `run`: 0; 3 if an item ended by a fault or outside
    acceptance; 75 after an interrupt.

    Examples:

    - `rig queue add procedure.toml --bench bench.toml --loop --until 07:00`
    - `rig queue list`
    - `rig queue run`
    """
    from rig.queue import work  # noqa: PLC0415
    from rig.run_file.events.queues import Queued, QueueMoved, QueuePaused, QueueRemoved  # noqa: PLC0415

    by = operator()
    at, now = _opened(file, database, machine)
    if action is Action.ADD:
        elsewhere = at.machine not in ("", gethostname())
        procedure = _of_another(what, bench, at.machine) if elsewhere else _checked(what, bench, dry=dry, world=world)
        options = _options(loop=loop, until=until, hours=hours, dry=dry, world=world)
        asked = Queued(
            item=0,
            command="loop" if loop else "run",
            procedure=str(procedure.absolute()),
            bench=str(bench.absolute()) if bench is not None else "",
            options=options,
            not_before_s=_moment(not_before),
            needs=needs or [],
            priority=priority,
            then=then.value,
            who=by.name,
            who_by=by.by,
            machine=at.machine or None,
        )
        now = at.append(asked)
    elif action in (Action.MOVE, Action.REMOVE):
        item = _item(now, what)
        event = QueueMoved(item=item.number, priority=priority, who=by.name) if action is Action.MOVE else None
        now = at.append(event or QueueRemoved(item=item.number, who=by.name))
    elif action is Action.PAUSE:
        now = at.append(QueuePaused(on=not off, who=by.name))
    elif action is Action.RUN:
        asked_to_end = signals()
        now = work(
            at,
            RealClock(),
            has=frozenset(has or ()),
            signals=asked_to_end,
            said=lambda words: err.print(escape(words), soft_wrap=True),
            stay=stay,
        )
        _show(now, as_json=as_json)
        if asked_to_end.interrupt:
            return ExitCode.INTERRUPTED
        own = [one for one in now.items.values() if one.machine == at.machine]
        bad = any(one.state in ("fault", "outside", "stopped") for one in own)
        return ExitCode.OUTSIDE_ACCEPTANCE if bad else ExitCode.DONE
    _show(now, as_json=as_json)
    return ExitCode.DONE


def _opened(file: Path, database: str, machine: str) -> tuple[Keeps, Queue]:
    """The queue that is meant, and its state."""
    from rig.queue import open_queue  # noqa: PLC0415

    if not database:
        if machine:
            raise UsageError("--machine names one of those that share a queue: add --database")
        return open_queue(file)
    from rig.database import Database  # noqa: PLC0415 - the extra may not be installed
    from rig.queue.shared import SharedQueue  # noqa: PLC0415

    shared = SharedQueue(Database(database), machine or gethostname(), file)
    return shared, shared.read()


def _of_another(what: str, bench: Path | None, machine: str) -> Path:
    """The procedure of an item for another machine, which has its files. Raises `UsageError`."""
    if not what or bench is None or not Path(what).is_absolute() or not bench.is_absolute():
        raise UsageError(f"an item for {machine} needs a procedure file and --bench, each by its whole path there")
    err.print(f"[yellow]files of {escape(machine)} cannot be checked here: that machine does when the item begins[/]")
    return Path(what)


def _checked(what: str, bench: Path | None, *, dry: bool, world: Path | None) -> Path:
    """The procedure of a new item, checked with its bench. Raises `UsageError` or `ConfigurationError`."""
    from rig.runs.plans import load_plan  # noqa: PLC0415

    if not what or bench is None:
        raise UsageError("rig queue add needs a procedure file and --bench")
    load_plan(Path(what), bench, dry=dry, world=world).permission()
    return Path(what)


def _options(*, loop: bool, until: str | None, hours: float | None, dry: bool, world: Path | None) -> list[str]:
    if not loop and (until is not None or hours is not None):
        raise UsageError("--until and --hours are the end of a loop: add --loop")
    found = ["--dry"] if dry else []
    found += ["--world", str(world.absolute())] if world is not None else []
    found += ["--until", until] if until is not None else []
    return [*found, *(["--hours", f"{hours:g}"] if hours is not None else [])]


def _moment(text: str) -> float | None:
    if not text:
        return None
    try:
        return datetime.fromisoformat(text).astimezone().timestamp()
    except ValueError:
        raise UsageError(f"--not-before {text}: a date and time such as 2026-01-15T18:00") from None


def _item(now: Queue, what: str) -> Item:
    """A waiting item by its number. Raises `UsageError`."""
    found = now.items.get(int(what)) if what.isdecimal() else None
    if found is None or found.state != "waiting":
        waiting = ", ".join(str(one.number) for one in now.waiting) or "none"
        raise UsageError(f"{what or 'nothing'} is not the number of a waiting item (waiting: {waiting})")
    return found


def _show(now: Queue, *, as_json: bool) -> None:
    """The items, at work, waiting and ended."""
    order = [*now.at_work, *now.waiting]
    order += [one for one in now.items.values() if one not in order]
    if as_json:
        print_json({"paused": now.paused, "held": now.held, "items": [_row(one) for one in order]})
        return
    shared = any(one.machine for one in order)
    head = (
        "item",
        *(("machine",) if shared else ()),
        "state",
        "command",
        "procedure",
        "bench",
        "priority",
        "waits for",
    )
    table = Grid(head, frame="plain", apart=2)
    for one in order:
        asked = one.asked
        at = (
            ""
            if asked.not_before_s is None
            else f"{datetime.fromtimestamp(asked.not_before_s, UTC):%Y-%m-%d %H:%M} UTC"
        )
        waits = [*asked.needs, *([at] if at else [])] if one.state == "waiting" else []
        if one.state == "waiting" and one.bench in now.held:
            waits.append(f"item {now.held[one.bench]} held the bench")
        names = (Path(asked.procedure).name, Path(asked.bench).name)
        table.add_row(
            str(one.number),
            *((escape(one.machine),) if shared else ()),
            one.state,
            asked.command,
            *map(escape, names),
            str(one.priority),
            escape(", ".join(waits)),
        )
    show((table,), out)
    if now.paused:
        err.print("[yellow]paused: nothing more begins; rig queue pause --off goes on[/]")


def _row(one: Item) -> dict[str, Any]:
    ended = one.ended
    return {
        **one.asked.body(),
        "priority": one.priority,
        "state": one.state,
        "exit_code": None if ended is None else ended.code,
        "file": None if ended is None else ended.file,
    }
