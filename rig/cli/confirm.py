"""`rig confirm`: proposes, runs and judges the run that separates confounded effects."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.bench.config import parse_toml, read_text
from rig.cli.commands import app
from rig.cli.confirm_show import listed, show, show_open, show_proposals
from rig.cli.kind_options import with_options_of_kinds
from rig.cli.options import JsonOption, RunArgument
from rig.cli.progress import run_progress
from rig.cli.run import conclude
from rig.cli.show import err, headline, print_json
from rig.cli.signals import signals
from rig.cli.waiting import waiting
from rig.engine.session import Outcome
from rig.errors import ExitCode, UsageError
from rig.files.atomic import check_files, check_format, write_whole
from rig.procedures.evaluate.results import Options
from rig.procedures.kind import Kind
from rig.procedures.present.shell import shell_word
from rig.runs.controller import start_run

MOST_RUNS = 3
"""Number of further runs in one command, at most."""

if TYPE_CHECKING:
    from rig.procedures.plan.further_runs import Variation
    from rig.runs.plans import Plan
    from rig.verbs.confirm.answers import Confirmed
    from rig.verbs.confirm.first import First
    from rig.verbs.confirm.proposal import Proposal


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
        list[Path] | None,
        typer.Option(help="judge by this existing run, and run nothing; repeat it for several", show_default=False),
    ] = None,
    after: Annotated[
        list[Path] | None,
        typer.Option(help="a further run that was made: propose the next one; repeat it for several"),
    ] = None,
    runs: Annotated[
        int, typer.Option(min=1, max=MOST_RUNS, help="make at most this many runs; stop when nothing is open")
    ] = 1,
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

    Examples:

    - `rig confirm RUN --dry --runs 3`
    - `rig confirm RUN --list`
    - `rig confirm RUN --by LATER_RUN`
    """
    from rig.verbs.confirm.answers import following, judge  # noqa: PLC0415
    from rig.verbs.confirm.first import check_way, open_asked  # noqa: PLC0415
    from rig.verbs.confirm.further_plan import plan_for  # noqa: PLC0415

    made = list(by or after or ())
    check_files(
        [write, check_format(report, ".html", ".htm")],
        [run_file, *filter(None, (bench, world)), *(by or ()), *(after or ())],
    )
    if world is not None and not dry:
        raise UsageError("--world describes a simulated bench; it requires --dry")
    _check_options(by, after, write, report, out_dir, only_list=only_list, take=take, runs=runs)
    texts = _texts({"bench": bench, "world": world})
    if not by:
        check_way(run_file, dry=dry or only_list or write is not None, rehearsed=dry, world=world is not None)
    first = open_asked(run_file, given, made)
    if not as_json:
        headline(run_file.name, first.traced.table)
    if not first.questions:
        err.print("nothing to confirm: the trace found no missing effect")
        if as_json:
            print_json({**listed(first, (), ()), "run": None, "effects": []})
        return ExitCode.DONE
    told = judge(first, *made) if made else None
    about: dict[str, Any] = {"first": str(run_file), "proposals": []}
    asked = first if told is None else following(told)
    if by or asked is None:
        assert told is not None
        return show(told, about, report, as_json=as_json)
    if only_list or write is not None:
        chosen, about = _chosen(first, asked, take, every=only_list, as_json=as_json)
        if write is not None and chosen is not None:
            _write_procedure(write, first, chosen.variation)
        if as_json:
            print_json(about)
        return ExitCode.DONE if chosen is not None or only_list else ExitCode.OUTSIDE_ACCEPTANCE
    for number in range(runs):
        chosen, about = _chosen(first, asked, take if number == 0 else 1, every=False, as_json=as_json)
        if chosen is None:
            break
        plan = plan_for(asked, chosen.variation, dry=dry, **texts)
        _wait_for_mounting(chosen, dry=dry, yes=yes and number == 0)
        path, ended = _run(plan, out_dir, asked.world_s + asked.later_s if dry else 0.0, dry=dry, as_json=as_json)
        made.append(path)
        if ended is not None:
            words = f"{first.command} {' '.join(f'--by {shell_word(path)}' for path in made)}"
            err.print(f"when it is complete (rig resume {escape(shell_word(path))}): {escape(words)}", soft_wrap=True)
            return ended
        told = judge(first, *made)
        now = following(told)
        if now is None or number + 1 == runs:
            return _end(told, about, report, dry=dry, as_json=as_json)
        if not as_json:
            show(told, about, None, as_json=False)
        asked = now
    if told is not None:
        return _end(told, about, report, dry=dry, as_json=as_json)
    if as_json:
        print_json(about)
    return ExitCode.OUTSIDE_ACCEPTANCE


def _texts(files: Mapping[str, Path | None]) -> dict[str, str | None]:
    """The named files, checked as TOML before any work. Raises `ConfigurationError`."""
    texts = {name: None if path is None else read_text(path, name) for name, path in files.items()}
    for name, text in texts.items():
        if text is not None:
            parse_toml(text, str(files[name]))
    return texts


def _check_options(
    by: Sequence[Path] | None,
    after: Sequence[Path] | None,
    write: Path | None,
    report: Path | None,
    out_dir: Path,
    *,
    only_list: bool,
    take: int,
    runs: int,
) -> None:
    if out_dir.exists() and not out_dir.is_dir():
        raise UsageError(f"{out_dir} is not a folder; name one for the run file with --out")
    if by and (write is not None or only_list or take > 1 or runs > 1 or after):
        raise UsageError("--by uses existing runs: it excludes --after, --list, --runs, --take and --write")
    if report is not None and (write is not None or only_list):
        raise UsageError("--report shows a judgement; with --list or --write there is none")


def _write_procedure(write: Path, first: First, run: Variation) -> None:
    """The procedure file of a further run, with what a person has to do as comments."""
    from rig.verbs.confirm.further_plan import procedure_text  # noqa: PLC0415

    lines = f"# {run.what}: to confirm the effects found in {first.path.name}\n"
    lines += "# Turn the package first.\n" if run.turned else ""
    lines += "".join(f"# {step.words}: the run waits, and `rig done` continues it.\n" for step in run.steps)
    text = lines + procedure_text(run.procedure, run.steps, routine=run.routine)
    write_whole(write, lambda file: file.write(text))
    err.print(f"procedure: {escape(str(write))}", soft_wrap=True)
    if first.ignore:  # a run of this file does not know it
        words = f"judge its run by {first.command} --by RUN; what takes --confirmed-by needs the same --ignore"
        err.print(escape(words), soft_wrap=True)


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


def _chosen(
    first: First, asked: First, take: int, *, every: bool, as_json: bool
) -> tuple[Proposal | None, dict[str, Any]]:
    """The run to make, None if there is none; and all of them for `--json`."""
    from rig.verbs.confirm.proposals import consider, inseparable, propose, unlikely  # noqa: PLC0415

    with waiting("considering further runs"):
        considered = consider(asked)
    proposals, never = propose(considered), inseparable(asked, considered)
    if not as_json:
        show_open(asked, never)
    if not proposals:
        err.print(
            "no run of this bench is proposed: none would separate the open pairs. Sizes alone are confirmed by the "
            f"same procedure again: rig run, then {escape(first.command)} --by LATER_RUN",
            soft_wrap=True,
        )
    elif take > len(proposals):
        raise UsageError(f"--take {take}: there are {len(proposals)} proposed runs; --list shows them")
    elif not as_json:
        show_proposals(asked, proposals, never, take, every=every)
    why = unlikely(proposals) if proposals else ""
    if why and not as_json:
        err.print(
            f"{escape(why)}. Run {take} is for what it can settle, and no run "
            f"longer than the first is proposed where one of its kind can be shorter; --take chooses another",
            soft_wrap=True,
        )
    return proposals[take - 1] if proposals else None, {**listed(first, proposals, never), "unlikely": why}


def _end(told: Confirmed, about: Mapping[str, Any], report: Path | None, *, dry: bool, as_json: bool) -> int:
    """Show the last verdict, and how to go on if something is open."""
    from rig.verbs.confirm.answers import following  # noqa: PLC0415

    code = show(told, about, report, as_json=as_json)
    if following(told) is not None:
        words = " ".join(f"--after {shell_word(path)}" for path in told.paths) + (" --dry" if dry else "")
        few = f"{escape(why)}; its further runs are unlikely to decide it" if (why := about.get("unlikely")) else ""
        err.print(
            f"{few or 'a further run may decide more'}: {escape(told.first.command)} {escape(words)}",
            soft_wrap=True,
        )
    return code


def _run(plan: Plan, out_dir: Path, world_s: float, *, dry: bool, as_json: bool) -> tuple[Path, int | None]:
    """Make a run: its file, and the exit code if it is not complete."""
    paths: list[Path] = []

    def announce(path: Path) -> None:
        paths.append(path)
        print(path, file=sys.stderr if as_json else sys.stdout, flush=True)

    with run_progress(simulated=dry or plan.bench.simulated) as progress:
        result = start_run(
            plan, out_dir, signals=signals(), announce=announce, on_progress=progress, world_start_s=world_s
        )
    code = conclude(result)
    return paths[0], None if result.outcome is Outcome.COMPLETE else code
