"""`rig confirm`: proposes, runs and judges the run that separates confounded effects."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Column, Table

from procedures.durations import duration
from procedures.kind import Kind
from procedures.results import Options
from rig.atomic import check_files, write_whole
from rig.cli import app
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.run import JsonOption, RunArgument, conclude, signals
from rig.cli.show import err, headline, mark, out, print_json, run_progress
from rig.config import parse_toml, read_text
from rig.controller import start_run
from rig.engine.session import Outcome
from rig.errors import ExitCode, UsageError
from rig.options import chosen as chosen_kind

SHOWN = 5
"""Number of proposals shown by default."""

if TYPE_CHECKING:
    from procedures.further_runs import Variation
    from rig.closed_loop.confirm.answers import Confirmed
    from rig.closed_loop.confirm.first import First
    from rig.closed_loop.confirm.proposal import Proposal
    from rig.closed_loop.confirm.proposals import Inseparable


def _options(kind: Kind) -> type[Options]:
    """A run is traced before it is confirmed, with the options of the trace."""
    return kind.trace_options


@app.command()
@with_options_of_kinds(_options)
def confirm(
    run_file: RunArgument,
    dry: Annotated[bool, typer.Option("--dry", help="run on simulated instruments")] = False,
    world: Annotated[
        Path | None,
        typer.Option(help="with --dry: the world file of the simulated bench", show_default="that of the first run"),
    ] = None,
    bench: Annotated[
        Path | None,
        typer.Option(
            "--bench", "-b", help="the bench file, if addresses have changed", show_default="that of the first run"
        ),
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for the run file")] = Path("runs"),
    only_list: Annotated[
        bool, typer.Option("--list", help="list possible runs and their separation, and stop")
    ] = False,
    take: Annotated[int, typer.Option(min=1, help="number of the listed run to make")] = 1,
    write: Annotated[
        Path | None, typer.Option(help="write the run's procedure file and stop; for `rig run`", show_default=False)
    ] = None,
    by: Annotated[
        Path | None, typer.Option(help="judge by this existing run, and run nothing", show_default=False)
    ] = None,
    report: Annotated[Path | None, typer.Option(help="write a self-contained HTML report", show_default=False)] = None,
    yes: Annotated[bool, typer.Option("--yes", help="the package is already mounted as required: do not wait")] = False,
    as_json: JsonOption = False,
    *,
    given: dict[str, Any],
) -> int:
    """Confirm effects found by a trace with a further run, and separate confounded causes with new data.

    Proposes runs on the same bench (at other rolls, with the package turned, at another temperature, in another order),
    with the expected separation of every pair of confounded causes in standard errors. Makes the run with the best
    separation per cost. Judges the causes with both runs, and the old and the new model with the further one alone.

    Examples: `rig confirm RUN --dry`, `rig confirm RUN --list`, `rig confirm RUN --by LATER_RUN`
    """
    from rig.closed_loop.confirm.answers import judge  # noqa: PLC0415
    from rig.closed_loop.confirm.first import check_way  # noqa: PLC0415
    from rig.closed_loop.confirm.plans import plan_for  # noqa: PLC0415
    from rig.closed_loop.confirm.proposals import consider, inseparable, propose  # noqa: PLC0415

    check_files([write, report], [run_file, *filter(None, (bench, world, by))])
    if world is not None and not dry:
        raise UsageError("--world describes a simulated bench; it requires --dry")
    _check_options(by, write, report, out_dir, only_list=only_list, take=take)
    texts = _texts({"bench": bench, "world": world})
    if by is None:
        check_way(run_file, dry=dry or only_list or write is not None, rehearsed=dry)
    first = _opened(run_file, given)
    if not as_json:
        headline(run_file.name, first.traced.table)
    if not first.questions:
        err.print("nothing to confirm: the trace found no missing effect")
        if as_json:
            print_json({**_listed(first, (), ()), "run": None, "effects": []})
        return ExitCode.DONE
    if by is not None:
        return _show(judge(first, by), {"first": str(run_file), "proposals": []}, report, as_json=as_json)
    considered = consider(first)
    proposals, never = propose(considered), inseparable(first, considered)
    if not as_json:
        _show_open(first, never)
    if not proposals:
        return _nothing_to_run(first, never, only_list=only_list, as_json=as_json)
    if take > len(proposals):
        raise UsageError(f"--take {take}: there are {len(proposals)} proposed runs; --list shows them")
    chosen = proposals[take - 1]
    if not as_json:
        _show_proposals(first, proposals, never, take, every=only_list)
    if only_list or write is not None:
        if write is not None:
            _write_procedure(write, run_file, chosen.variation)
            err.print(f"procedure: {escape(str(write))}", soft_wrap=True)
        if as_json:
            print_json(_listed(first, proposals, never))
        return ExitCode.DONE
    plan = plan_for(first, chosen.variation, dry=dry, **texts)
    _wait_for_mounting(chosen, dry=dry, yes=yes)
    paths: list[Path] = []

    def announce(path: Path) -> None:
        paths.append(path)
        print(path, file=sys.stderr if as_json else sys.stdout, flush=True)

    with run_progress(simulated=dry or plan.bench.simulated) as show:
        result = start_run(
            plan,
            out_dir,
            signals=signals(),
            announce=announce,
            on_progress=show,
            world_start_s=first.world_s + first.later_s if dry else 0.0,
        )
    code = conclude(result)
    if result.outcome is not Outcome.COMPLETE:
        err.print(
            f"when it is complete (rig resume {escape(str(paths[0]))}): "
            f"rig confirm {escape(str(run_file))} --by {escape(str(paths[0]))}",
            soft_wrap=True,
        )
        return code
    return _show(judge(first, paths[0]), _listed(first, proposals, never), report, as_json=as_json)


def _opened(run_file: Path, given: Mapping[str, Any]) -> First:
    """The run, traced with the options of its kind."""
    from rig.closed_loop.confirm.first import check_run_file, open_traced  # noqa: PLC0415
    from rig.tables import FileSource  # noqa: PLC0415

    check_run_file(run_file)
    _, options = chosen_kind(FileSource(run_file), given, _options)
    return open_traced(run_file, **options.model_dump(exclude_unset=True))


def _texts(files: Mapping[str, Path | None]) -> dict[str, str | None]:
    """The named files, checked as TOML before any work. Raises `ConfigurationError`."""
    texts = {name: None if path is None else read_text(path, name) for name, path in files.items()}
    for name, text in texts.items():
        if text is not None:
            parse_toml(text, str(files[name]))
    return texts


def _check_options(
    by: Path | None, write: Path | None, report: Path | None, out_dir: Path, *, only_list: bool, take: int
) -> None:
    if out_dir.exists() and not out_dir.is_dir():
        raise UsageError(f"{out_dir} is not a folder; name one for the run file with --out")
    if by is not None and (write is not None or only_list or take > 1):
        raise UsageError("--by uses an existing run: it excludes --list, --take and --write")
    if report is not None and (write is not None or only_list):
        raise UsageError("--report shows a judgement; with --list or --write there is none")


def _write_procedure(write: Path, run_file: Path, run: Variation) -> None:
    """The procedure file of a further run, with what a person has to do as comments."""
    from rig.closed_loop.confirm.plans import procedure_text  # noqa: PLC0415

    lines = f"# {run.what}: to confirm the effects found in {run_file.name}\n"
    lines += "# Turn the package first.\n" if run.turned else ""
    lines += "".join(f"# {step.words}: the run waits, and `rig done` continues it.\n" for step in run.steps)
    text = lines + procedure_text(run.procedure, run.steps, routine=run.routine)
    write_whole(write, lambda file: file.write(text))


def _wait_for_mounting(chosen: Proposal, *, dry: bool, yes: bool) -> None:
    """Ask a person to turn the package; the simulated bench does it by itself."""
    if not chosen.variation.turned or dry or yes:
        return
    at = chosen.mounting or dict.fromkeys(("x_deg", "y_deg", "z_deg"), 0.0)
    words = (
        f"the run is {chosen.variation.what}, as it is mounted now (then, against its usual mounting, turned by "
        f"{at['x_deg']:g} deg about x, {at['y_deg']:g} about y, {at['z_deg']:g} about z): mount it so"
    )
    if not sys.stdin.isatty():
        raise UsageError(f"{words}, then give the same command with --yes; or choose another run with --take")
    typer.confirm(f"{words}, and confirm", abort=True, err=True)


def _listed(first: First, proposals: Sequence[Proposal], never: Sequence[Inseparable]) -> dict[str, Any]:
    """Values for `--json`."""
    return {
        "first": str(first.path),
        "proposals": [p.to_json() for p in proposals],
        "inseparable": [one.to_json() for one in never],
    }


def _nothing_to_run(first: First, never: Sequence[Inseparable], *, only_list: bool, as_json: bool) -> int:
    if as_json:
        print_json(_listed(first, (), never))
    err.print(
        "no run of this bench is proposed: none would separate the open pairs. Sizes alone are confirmed by the same "
        f"procedure again: rig run, then rig confirm {escape(str(first.path))} --by LATER_RUN",
        soft_wrap=True,
    )
    return ExitCode.DONE if only_list else ExitCode.OUTSIDE_ACCEPTANCE


def _show_open(first: First, never: Sequence[Inseparable]) -> None:
    """Open questions, and those that no run can answer."""
    for question in first.questions:
        alike = [m.effect for m in question.members[1:]]
        text = f"not distinguishable from {', '.join(alike)} by these data" if alike else "it is not confounded"
        out.print(f"[bold]{escape(question.effect)}[/]: {escape(text)}", soft_wrap=True)
    for one in never:
        a, b = one.pair
        does = (
            f"a run with a change by a person does: {'; or '.join(one.by_hand)}"
            if one.by_hand
            else f"a person would have to change something: {one.would}"
        )
        out.print(
            f"  [yellow]{escape(a)} or {escape(b)}: no run of this bench separates them (at most {one.sigmas:.1f} "
            f"standard errors expected) as it stands; {escape(does)}[/]",
            soft_wrap=True,
        )


def _show_proposals(
    first: First, proposals: Sequence[Proposal], never: Sequence[Inseparable], take: int, *, every: bool
) -> None:
    from rig.closed_loop.confirm.proposal import SURE  # noqa: PLC0415
    from rig.closed_loop.confirm.proposals import otherwise  # noqa: PLC0415

    table = Table("", "run", "points", "bench time", "pairs separated", "nearest pair", "shown by")
    shown = proposals if every else proposals[: max(take, SHOWN)]
    for number, proposal in enumerate(shown, start=1):
        separated, pairs = proposal.separated
        table.add_row(
            f"[green]{number}[/]" if number == take else str(number),
            proposal.variation.what,
            proposal.size,
            duration(proposal.hours * 3600.0),
            f"{separated} of {pairs}" if pairs else "-",
            "-" if proposal.nearest is None else _weakest(*proposal.nearest),
            _weakest(*proposal.shown),
        )
    out.print(table)
    out.print(
        f"  pairs separated: with probability {SURE:.0%} or more; nearest pair, and weakest cause against none: "
        "expected standard errors, and the probability that they are enough",
        soft_wrap=True,
    )
    if len(proposals) > len(shown):
        out.print(f"  and {len(proposals) - len(shown)} more: --list shows them")
    for line in otherwise(first, proposals[take - 1], never):
        out.print(f"  [yellow]run {take}: {escape(line)}[/]", soft_wrap=True)


def _weakest(chance: float, sigmas: float) -> str:
    from rig.closed_loop.confirm.proposal import SURE  # noqa: PLC0415

    text = f"{sigmas:.1f} ({chance:.0%})" if sigmas < 100 else f"{sigmas:.0f} ({chance:.0%})"
    return f"[green]{text}[/]" if chance >= SURE else text


def _show(confirmed: Confirmed, listed: Mapping[str, Any], report: Path | None, *, as_json: bool) -> int:
    from rig.closed_loop.confirm.answers import chance, sentences, sizes  # noqa: PLC0415

    code = ExitCode.DONE if confirmed.settled else ExitCode.OUTSIDE_ACCEPTANCE
    if as_json:
        print_json({**listed, **confirmed.to_json()})
        _write_report(confirmed, report)
        return code
    out.print(f"\n{mark(confirmed.first.simulated)}judged by {escape(str(confirmed.path))}", soft_wrap=True)
    for answer in confirmed.answers:
        out.print(f"\n[bold]{escape(answer.effect)}[/]: [bold]{answer.verdict}[/]")
        shown = "shown by"
        table = Table(Column("cause", no_wrap=True), "behind by", shown, "same size?", "size in the further run, 95 %")
        for member in answer.members:
            table.add_row(
                f"[green]{escape(member.effect)}[/]" if member.holds else escape(member.effect),
                f"{member.sigmas:.1f} sd",
                f"{member.shown:.1f} sd (limit {member.limit:.1f}), p {chance(member.p_shown)}",
                f"p {member.p_changed:.2g}" + ("" if member.fits else ", does not fit"),
                escape("\n".join(sizes(member)) or "not told"),
            )
        out.print(table)
        if answer.outliers:
            which = ", ".join(str(row + 1) for row in answer.outliers)
            out.print(
                f"  [yellow]observations {which} of the further run are outliers and were left out[/]", soft_wrap=True
            )
    columns = ("declared model", "with the effects", "scatter of a reading")
    errors = Table(f"error on the further run / {confirmed.unit}", *columns)
    for name, e in confirmed.judged.errors.items():
        errors.add_row(escape(name), *(f"{confirmed.inferred(e, v):.3g}" for v in (e.before, e.after, e.sigma)))
    out.print()
    out.print(errors)
    if confirmed.own:
        out.print(f"  of both models: {confirmed.own}", soft_wrap=True)
    out.print()
    for sentence in sentences(confirmed):
        out.print(escape(sentence), soft_wrap=True)
    _write_report(confirmed, report)
    return code


def _write_report(confirmed: Confirmed, report: Path | None) -> None:
    if report is None:
        return
    from rig.report.confirm import write_confirm_report  # noqa: PLC0415

    write_confirm_report(report, confirmed)
    err.print(f"report: {escape(str(report))}", soft_wrap=True)
