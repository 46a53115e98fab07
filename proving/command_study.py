"""`rig study`: published work done again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.progress import run_progress
from rig.cli.show import err, mark, out, print_json
from rig.engine.session import Progress
from rig.errors import ExitCode, UsageError
from rig.files.atomic import check_files, write_whole

study_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Reproduce published work, and compare with the printed results.\n\nExamples:\n\n"
    "- `rig study paper --out paper`\n"
    "- `rig study paper --figures-only --out figures`\n- `rig study paper --seeds 20 --json --out paper`",
)
app.add_typer(study_app, name="study")


@study_app.callback()
def _study() -> None:
    """Keep `paper` a command of its own while it is the only study."""


@study_app.command()
def paper(
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="folder for the figures and paper.html")] = Path("paper"),
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="write the tables as Markdown, too", show_default=False)
    ] = None,
    figures_only: Annotated[
        bool, typer.Option("--figures-only", help="no experiments: Table 1, figures 1 to 21, critical values")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=10**9, help="of the simulated noise")] = 1,
    seeds: Annotated[
        int, typer.Option(min=1, max=100, help="run the experiments so often and count how often each check holds")
    ] = 1,
    keep_runs: Annotated[
        Path | None, typer.Option(help="keep the run files in this folder", show_default=False)
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Reproduce NASA/TP-1999-209835: tables, figures 1 to 54, and what the paper says of them.

    Table 1, figures 1 to 21 and the critical values of Table 2 are computed and held against the print. Experiments 22
    to 54 are run on the simulated bench by the real controller, 9,000 points, 85 hours of bench time, and
    checked for the patterns that the paper reports. About a minute.

    Example: `rig study paper --out paper --markdown paper.md`
    """
    from proving.paper import markdown, reproduce, without_experiments  # noqa: PLC0415 - plots take a second to import
    from proving.paper.html import write_pages  # noqa: PLC0415

    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{out_dir} cannot be made: {error.strerror}; choose another folder with --out") from error

    check_files([markdown_file, out_dir / "paper.html"], [])

    def say(what: str) -> None:
        err.print(escape(what), soft_wrap=True)

    if figures_only:
        study = without_experiments()
    else:
        study = reproduce(range(seed, seed + seeds), say=say, watch=_watch, runs=keep_runs)
    page = write_pages(study, out_dir, say)
    if markdown_file is not None:
        options = "".join(
            f" {name} {value}" for name, value, plain in (("--seed", seed, 1), ("--seeds", seeds, 1)) if value != plain
        )
        command = f"rig study paper{' --figures-only' if figures_only else options} --markdown {markdown_file}"
        write_whole(markdown_file, lambda file: file.write(markdown(study.sections, command)))
    if as_json:
        print_json(study.to_json())
        return ExitCode.DONE
    for section in study.sections:
        if section.statements:
            agree = sum(s.agrees for s in section.statements)
            out.print(f"{agree:4d} of {len(section.statements):<3d} agree: {escape(section.title)}")
            for s in (s for s in section.statements if not s.agrees):
                beside = f"printed {s.printed}, " if s.printed else ""
                note = f" ({s.note})" if s.note else ""
                text = f"{s.where}: {s.says}: {beside}computed {s.computed}, wanted {s.criterion}{note}"
                out.print(f"       [yellow]{escape(text)}[/]", soft_wrap=True)
    out.print(f"{mark(study.simulated)}{escape(str(page))}", soft_wrap=True)
    return ExitCode.DONE


@contextmanager
def _watch() -> Iterator[Callable[[Progress], None]]:
    """A bar a night on a terminal; a log has a line a night already."""
    if not err.is_terminal:
        yield lambda _: None
        return
    with run_progress(simulated=True) as show:
        yield show
