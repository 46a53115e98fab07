"""Every command: under which heading of the help, in which module it is written, and what it does in one sentence.

A module is imported when its command is asked for, so that `rig --help` need not wait for the fitter. The sentence is
the first of the command's own help; a test holds them against each other.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info, get_command_name, get_group_from_info


class Entry(NamedTuple):
    """A command, as the help lists it."""

    heading: str
    module: str
    does: str


_RUNNING, _DATA, _TRYING = "Running", "Data", "Trying it out"
COMMANDS = {
    "run": Entry(_RUNNING, "rig.cli.run", "Carry out a procedure on a bench."),
    "resume": Entry(_RUNNING, "rig.cli.run", "Carry on with an interrupted run."),
    "doctor": Entry(
        _RUNNING,
        "rig.cli.doctor",
        "Check everything that can be known before a night: bench, disk, clock, machine, and who will be told.",
    ),
    "plan": Entry(
        _RUNNING,
        "rig.cli.plan",
        "Answer the evening question: how many points, done when and how sure, how precise, is anything in the way?",
    ),
    "hold": Entry(
        _RUNNING,
        "rig.cli.requests",
        "Stop all motion, leave chambers as they are, and wait; `rig release` lets the run go on.",
    ),
    "release": Entry(_RUNNING, "rig.cli.requests", "Let a held run go on."),
    "stop": Entry(_RUNNING, "rig.cli.requests", "Park the bench and end the session; the run can be resumed later."),
    "service": Entry(
        _RUNNING,
        "rig.cli.service",
        "Print, install or remove the systemd unit that carries a run on: after a crash, a hang, a power cut.",
    ),
    "status": Entry(
        _RUNNING,
        "rig.cli.status",
        "Show what a run has come to, running or not; of a folder, its runs, the newest first.",
    ),
    "watch": Entry(
        _RUNNING,
        "rig.cli.watch",
        "Serve a page that shows a run as it goes: state, time left, readings, residuals, warnings.",
    ),
    "fit": Entry(
        _DATA,
        "rig.cli.data",
        "Fit the declared model to every sensor; analyse replications, or whole plots with all methods side by side.",
    ),
    "trace": Entry(
        _DATA, "rig.cli.data", "Find what the declared model lacks: residual, effect, error before and after."
    ),
    "infer": Entry(
        _DATA,
        "rig.cli.infer",
        "Infer from outputs what their sensors were calibrated for, with 95 % intervals.",
    ),
    "export": Entry(_DATA, "rig.cli.export", "Write a run's observations as CSV, units in the column names."),
    "chart": Entry(
        _DATA,
        "rig.cli.chart",
        "Chart the parameters of sensors over several calibrations: is one drifting, and when is it due again?",
    ),
    "confirm": Entry(
        _DATA,
        "rig.cli.confirm",
        "Confirm by a further run what a trace found: which of the confounded causes holds, on data that are new.",
    ),
    "verify": Entry(
        _DATA,
        "rig.cli.verify",
        "Check that a run file is whole and its contents make sense; say what was changed, and where.",
    ),
    "demo": Entry(
        _TRYING,
        "rig.cli.demo",
        "Run a simulated night with effects nobody declared, kill it partway, resume it, and find them.",
    ),
    "sim": Entry(
        _TRYING, "rig.cli.sim", "Serve a simulated bench to other programs: pseudo-terminals, a local TCP port, slcan."
    ),
    "night": Entry(
        _TRYING,
        "rig.cli.proving",
        "Play simulated nights full of faults, crashes and power cuts, and check what must hold after each.",
    ),
    "study": Entry(_TRYING, "rig.cli.proving", "Do published work again, and hold it against what was printed."),
}


class Commands(TyperGroup):
    """The commands of the table; each becomes the real one when it is asked for."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._loaded: set[str] = set()
        self.commands = {
            name: TyperCommand(name, help=entry.does, rich_help_panel=entry.heading, rich_markup_mode="markdown")
            for name, entry in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first argument names, and the arguments left for it."""
        if args and args[0] in COMMANDS.keys() - self._loaded:
            self.commands[args[0]] = loaded(args[0])
            self._loaded.add(args[0])
        return super().resolve_command(ctx, args)


def loaded(name: str) -> Any:
    """The command of that name, with its options: imports its module."""
    from rig.cli import app  # noqa: PLC0415 - which is made of this class

    import_module(COMMANDS[name].module)
    settings: dict[str, Any] = {"pretty_exceptions_short": True, "rich_markup_mode": "markdown"}
    for group in app.registered_groups:
        if group.name == name:
            return get_group_from_info(group, suggest_commands=True, **settings)
    for command in app.registered_commands:
        if command.callback is not None and (command.name or get_command_name(command.callback.__name__)) == name:
            return get_command_from_info(command, **settings)
    raise LookupError(f"{COMMANDS[name].module} has no command {name}")
