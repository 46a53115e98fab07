"""All commands: heading in the help, module, and a one-sentence description.

A module is imported when its command is called, so that `rig --help` is fast. The sentence is the first of the
command's own help; a test compares them.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info, get_command_name, get_group_from_info


class Entry(NamedTuple):
    """A command in the list of the help."""

    heading: str
    module: str
    does: str


_RUNNING, _PEOPLE, _DATA, _TRYING = "Running", "People", "Data", "Trying"
COMMANDS = {
    "run": Entry(_RUNNING, "rig.cli.run", "Carry out a procedure on a bench."),
    "resume": Entry(_RUNNING, "rig.cli.run", "Resume an interrupted run."),
    "loop": Entry(
        _RUNNING,
        "rig.cli.loop",
        "Run a procedure, find and confirm what its model lacks by further runs, and calibrate, until a time.",
    ),
    "queue": Entry(
        _RUNNING,
        "rig.cli.queue",
        "Carry out runs and loops one after the other on a bench, several benches at once.",
    ),
    "doctor": Entry(
        _RUNNING,
        "rig.cli.doctor",
        "Check bench, disk, clock, machine and notifications before an unattended run.",
    ),
    "plan": Entry(
        _RUNNING,
        "rig.cli.plan",
        "Forecast a run: number of points, time of its end, precision, and problems.",
    ),
    "new": Entry(
        _RUNNING,
        "rig.cli.new",
        "Ask what you set and read, show the plan, and write bench, procedure and register.",
    ),
    "instrument": Entry(
        _RUNNING,
        "rig.cli.instrument",
        'List, show, check, begin or look for instruments that are tables: `driver = "./my_bath.toml"`.',
    ),
    "hold": Entry(
        _RUNNING,
        "rig.cli.requests",
        "Stop all motion, leave chambers as they are, and wait; `rig release` continues the run.",
    ),
    "release": Entry(_RUNNING, "rig.cli.requests", "Continue a held run."),
    "done": Entry(_RUNNING, "rig.cli.requests", "Say that a step by hand is done; the run goes on."),
    "correct": Entry(
        _RUNNING,
        "rig.cli.correct",
        "Correct an entry that a person typed; both values stay in the run file, with the reason and the name.",
    ),
    "stop": Entry(_RUNNING, "rig.cli.requests", "Park the bench and end the session; the run can be resumed later."),
    "service": Entry(
        _RUNNING,
        "rig.cli.service",
        "Print, install or remove the systemd unit that continues a run after a crash, a hang or a power cut.",
    ),
    "status": Entry(
        _RUNNING,
        "rig.cli.status",
        "Show the state of a run, running or not; for a folder, its runs, newest first.",
    ),
    "watch": Entry(
        _RUNNING,
        "rig.cli.watch",
        "Serve a live page of a run: state, remaining time, readings, residuals, warnings.",
    ),
    "serve": Entry(
        _PEOPLE,
        "rig.cli.serve",
        "Serve a laboratory: benches, queue, runs, proposals, results, and acts of people who are logged in.",
    ),
    "mcp": Entry(
        _PEOPLE,
        "rig.cli.serve",
        "Let a language model see a laboratory and propose runs, by the Model Context Protocol.",
    ),
    "act": Entry(_PEOPLE, "rig.cli.serve", "Do in a laboratory what its pages do, as a person with a password."),
    "person": Entry(
        _PEOPLE,
        "rig.cli.people",
        "People of a laboratory: who they are, what they may do, and their passwords.",
    ),
    "propose": Entry(
        _PEOPLE,
        "rig.cli.proposals",
        "Propose a run: its dry run, and everything that decides the real one, for somebody else to approve.",
    ),
    "approve": Entry(
        _PEOPLE,
        "rig.cli.proposals",
        "Show proposals; approve or decline one that somebody else made.",
    ),
    "log": Entry(
        _PEOPLE,
        "rig.cli.people",
        "Changes of people, equipment and settings of a laboratory: who, when, what before, what after.",
    ),
    "fit": Entry(
        _DATA,
        "rig.cli.data",
        "Fit the declared model to every sensor; analyse replications, or whole plots by all methods.",
    ),
    "trace": Entry(
        _DATA, "rig.cli.data", "Find effects missing in the declared model: residual, effect, error before and after."
    ),
    "budget": Entry(
        _DATA,
        "rig.cli.budget",
        "Uncertainty budgets of the results of a run, by its register of equipment.",
    ),
    "infer": Entry(
        _DATA,
        "rig.cli.infer",
        "Infer the measured quantity from outputs by a calibration, with 95 % intervals.",
    ),
    "export": Entry(
        _DATA, "rig.cli.export", "Write a run's observations as CSV or Parquet, units in the column names."
    ),
    "chart": Entry(
        _DATA,
        "rig.cli.chart",
        "Chart the parameters of sensors over several calibrations: drift, and the next due date.",
    ),
    "confirm": Entry(
        _DATA,
        "rig.cli.confirm",
        "Confirm effects found by a trace with a further run, and separate confounded causes with new data.",
    ),
    "lab": Entry(
        _DATA,
        "rig.cli.lab",
        "Say what is due in a laboratory, the history of an item, or which certificates rest on a piece of equipment.",
    ),
    "verify": Entry(
        _DATA,
        "rig.cli.verify",
        "Check that a run file is intact and its contents are consistent; report changes and their places.",
    ),
    "certificate": Entry(
        _DATA,
        "rig.cli.certificate",
        "Certificate of a run: on paper (PDF), as a page (HTML), and as digital calibration certificate (XML).",
    ),
    "seal": Entry(
        _DATA,
        "rig.cli.seal",
        "Seal a run file and its certificates: a signature by a key, or the time stamp of an authority.",
    ),
    "explain": Entry(
        _TRYING,
        "rig.cli.explain",
        "Explain the keys of files, options of instruments, effects, models, commands, and exit codes.",
    ),
    "demo": Entry(
        _TRYING,
        "rig.cli.demo",
        "Run a simulated night with undeclared effects, kill it partway, resume it, and find the effects.",
    ),
    "sim": Entry(
        _TRYING, "rig.cli.sim", "Serve a simulated bench to other programs: pseudo-terminals, local TCP ports, slcan."
    ),
    "night": Entry(
        _TRYING,
        "rig.cli.proving",
        "Simulate nights with faults, crashes and power cuts, and check invariants after each.",
    ),
    "study": Entry(_TRYING, "rig.cli.proving", "Reproduce published work, and compare with the printed results."),
}


class Commands(TyperGroup):
    """The commands of the table; each is imported at its first use."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._loaded: set[str] = set()
        self.commands = {
            name: TyperCommand(name, help=entry.does, rich_help_panel=entry.heading, rich_markup_mode="markdown")
            for name, entry in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command named by the first argument, and the remaining arguments."""
        if args and args[0] in COMMANDS.keys() - self._loaded:
            self.commands[args[0]] = loaded(args[0])
            self._loaded.add(args[0])
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="rig",
    cls=Commands,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="Runs calibration experiments overnight, survives crashes, fits the data, and traces the residual to the "
    "effect the model lacks.\n\n"
    "Exit codes: 0 done, 1 fault (bench safe), 2 usage, 3 done but outside acceptance, 4 stopped by `rig stop`, "
    "5 fault and NOT safe, 6 still running (`rig status --check`), 75 interrupted (resumable), 78 bad configuration.",
)


def loaded(name: str) -> Any:
    """The command of that name, with its options: imports its module."""
    import_module(COMMANDS[name].module)
    settings: dict[str, Any] = {"pretty_exceptions_short": True, "rich_markup_mode": "markdown"}
    for group in app.registered_groups:
        if group.name == name:
            return get_group_from_info(group, suggest_commands=True, **settings)
    for command in app.registered_commands:
        if command.callback is not None and (command.name or get_command_name(command.callback.__name__)) == name:
            return get_command_from_info(command, **settings)
    raise LookupError(f"{COMMANDS[name].module} has no command {name}")
