"""`rig propose`, `rig approve`: two keys for a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import BenchOption, JsonOption, ProcedureArgument
from rig.cli.people import LabOption
from rig.cli.progress import run_progress
from rig.cli.show import err, out, print_json
from rig.cli.signed_in import LoginOption, signed_in
from rig.errors import ExitCode
from rig.lab import laboratory_in
from rig.lab.laboratory import Proposal
from rig.lab.proposals import decide, known
from rig.procedures.present.blocks import Grid
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import show
from rig.procedures.present.visible import visible_line
from rig.run_file.approval import digests_of


@app.command()
def propose(
    procedure: ProcedureArgument,
    bench: BenchOption,
    why: Annotated[str, typer.Option(help="reason, for the approver", show_default=False)] = "",
    login: LoginOption = None,
    as_json: JsonOption = False,
) -> int:
    """Propose a run: its dry run, and everything that decides the real one, for somebody else to approve.

    The dry run takes `world.toml` beside the bench, if there is one. The proposal is a record of the laboratory's log;
    it has the texts of all files. A bench with `approval = true` runs for real only what was approved, byte by byte.

    Examples:

    - `rig propose night.toml --bench bench.toml`
    - `rig propose night.toml --bench bench.toml --login anna`
    - `rig propose night.toml --bench bench.toml --why "after the repair"`
    """
    from rig.verbs.propose import proposed  # noqa: PLC0415

    by = signed_in(laboratory_in(bench.parent), login, "operator")
    with run_progress(simulated=True) as progress:
        made = proposed(procedure, bench, by, why=why, on_progress=progress)
    if as_json:
        print_json(made.to_json())
    else:
        _show(made)
    return ExitCode.DONE


@app.command()
def approve(
    number: Annotated[
        int | None, typer.Argument(help="number of a proposal; without one, all are listed", show_default=False)
    ] = None,
    login: LoginOption = None,
    decline: Annotated[bool, typer.Option("--decline", help="decline it instead")] = False,
    why: Annotated[str, typer.Option(help="reason", show_default=False)] = "",
    lab: LabOption = Path(),
    as_json: JsonOption = False,
) -> int:
    """Show proposals; approve or decline one that somebody else made.

    Without --login it shows the proposal: dry run, extremes of every axis, outputs left on, SHA-256 of every file. An
    approval needs the role approver, another person than the proposer, and the password. It holds for one run.

    Examples:

    - `rig approve`
    - `rig approve 3`
    - `rig approve 3 --login ben`
    """
    laboratory = laboratory_in(lab)
    log = laboratory.verified_log()
    if number is None:
        _list(list(log.proposals.values()), as_json=as_json)
        return ExitCode.DONE
    proposal = known(log, number)
    if login is not None:
        by = signed_in(laboratory, login, "approver")
        proposal = decide(laboratory, number, "declined" if decline else "approved", why, by)
    if as_json:
        print_json(proposal.to_json())
    else:
        _show(proposal)
    return ExitCode.DONE


def _list(proposals: list[Proposal], *, as_json: bool) -> None:
    if as_json:
        print_json([one.to_json() for one in proposals])
        return
    table = Grid(("number", "state", "procedure", "bench", "proposed by"), frame="plain", apart=2)
    for one in proposals:
        table.add_row(
            str(one.number),
            one.state,
            *(escape(visible_line(text)) for text in (one.asked.procedure, one.asked.bench, one.asked.who)),
        )
    show((table,), out)


def _show(proposal: Proposal) -> None:
    for line in lines(proposal):
        out.print(escape(line), soft_wrap=True, highlight=False)
    if proposal.state == "waiting":
        how = f"rig approve {shell_word(proposal.number)} --login LOGIN"
        err.print(f"somebody else than {escape(proposal.asked.who)}: {how}", soft_wrap=True)


def lines(proposal: Proposal) -> list[str]:
    """A proposal in words; no text of others makes a further line."""
    asked, dry = proposal.asked, proposal.asked.dry
    found = [f"proposal {proposal.number}, {proposal.state}: {asked.procedure} on {asked.bench}, by {asked.who}"]
    if asked.why:
        found.append(f"  {asked.why}")
    if proposal.decided is not None:
        why = f": {proposal.decided.why}" if proposal.decided.why else ""
        found.append(f"  {proposal.decided.decision} by {proposal.decided.who}{why}")
    if proposal.used:
        found.append(f"  used by {proposal.used}")
    world = "in world.toml" if dry.get("world") else "in a world without hidden effects"
    message = f", {dry['message']}" if dry.get("message") else ""
    done = f"{dry.get('observed')} of {dry.get('points')} points in {dry.get('hours')} h"
    found.append(f"  dry run {world}: {dry.get('outcome')}{message}; {done}")
    found += [f"  {name}: {low:g} to {high:g}" for name, (low, high) in dry.get("extremes", {}).items()]
    found += [f"  {one}" for one in dry.get("left_on", [])] or ["  nothing stays on"]
    found += [f"  warning: {one}" for one in dry.get("warnings", [])]
    found += [f"  {digest}  {name}" for name, digest in digests_of(asked.documents).items()]
    found.append(f"  {asked.run_list}  run list")
    return [visible_line(line) for line in found]
