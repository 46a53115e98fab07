"""`rig new`: the first files of a laboratory."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.progress import run_progress
from rig.cli.show import err, out, show_notes
from rig.errors import ExitCode, RigError
from rig.procedures.present.shell import shell_word
from rig.procedures.present.terminal import show

if TYPE_CHECKING:
    from rig.new.questions import Question


@app.command()
def new(
    folder: Annotated[Path, typer.Argument(help="folder of the files; made if it does not exist")] = Path("my-lab"),
    answers_file: Annotated[
        Path | None, typer.Option("--answers", help="take the answers from this file", show_default=False)
    ] = None,
    show_only: Annotated[bool, typer.Option("--show", help="print the files, write nothing")] = False,
) -> int:
    """Ask what you set and read, show the plan, and write bench, procedure and register.

    Every question has a default and says why it is asked. Nothing is written before you agree, after Ctrl-C, or over
    an existing file. The answers are kept in `answers.toml`.

    Examples:

    - `rig new my-lab`
    - `rig new my-lab --answers answers.toml`
    - `rig new --answers answers.toml --show`
    """
    from rig.bench.config import parse_toml, read_text  # noqa: PLC0415
    from rig.new.files import NAMES, beside, refuse_existing, texts, write  # noqa: PLC0415
    from rig.new.questions import completed  # noqa: PLC0415

    if not show_only:
        refuse_existing(folder, NAMES)
    if answers_file is not None:
        given = parse_toml(read_text(answers_file, "answers"), str(answers_file))
        answers = completed(beside(given, answers_file.parent), str(answers_file))
        files = texts(answers)
        _plan(files)
    else:
        try:
            answers = _asked("Print" if show_only else "Write")
            files = texts(answers)
        except (typer.Abort, KeyboardInterrupt):
            err.print("\nnothing was written")
            raise
    if show_only:
        for name, text in files.items():
            print(f"# ---- {name}\n{text}")
        return ExitCode.DONE
    write(folder, files)
    _told(folder, answers)
    return ExitCode.DONE


def _told(folder: Path, answers: dict[str, Any]) -> None:
    from rig.new.answers import UNKNOWN  # noqa: PLC0415
    from rig.new.planned import before_run  # noqa: PLC0415

    if answers["model"] == UNKNOWN:
        err.print("no model was named: the straight line is taken; `rig trace RUN` says what it lacks")
    for words in before_run(answers):
        err.print(escape(words), soft_wrap=True)
    err.print(f"written into {escape(str(folder))}; next:")
    err.print(f"  cd {escape(shell_word(folder))}", soft_wrap=True)
    err.print("  rig run procedure.toml --bench bench.toml --dry --world world.toml", soft_wrap=True)


def _plan(files: dict[str, str]) -> None:
    """Show the plan of these files, as `rig plan` does. Raises `RigError`."""
    from rig.new.planned import planned  # noqa: PLC0415

    with run_progress(simulated=True) as progress:
        plan, blocks = planned(files, progress)
    show(blocks, out)
    show_notes(plan)


def _asked(act: str) -> dict[str, Any]:
    """Ask all questions, show the plan, and ask again what a person wants to change."""
    from rig.new.files import texts  # noqa: PLC0415
    from rig.new.questions import due  # noqa: PLC0415

    given: dict[str, Any] = {}
    while True:
        answers: dict[str, Any] = {}
        for question in due(answers):
            kept = given.get(question.key)
            with contextlib.suppress(ValueError):
                if kept is not None:
                    answers[question.key] = question.check(kept, answers)
                    continue
            answers[question.key] = _answer(question, answers)
        try:
            _plan(texts(answers))
            ready, words = True, f"{act} these files? yes, no, or the name of an answer to change it"
        except RigError as error:
            err.print(f"[bold red]{escape(str(error))}[/]", soft_wrap=True)
            ready, words = False, "Which answer do you want to change?"
        err.print(f"[dim]answers: {escape(', '.join(answers))}[/]", soft_wrap=True)
        said = _prompt(words, "yes" if ready else "model")
        while said not in answers:
            if ready and said in ("yes", "y"):
                return answers
            if said in ("no", "n"):
                raise typer.Abort
            said = _prompt(f"{said!r} is no answer; yes, no, or one of {', '.join(answers)}", "yes" if ready else "no")
        given = {key: value for key, value in answers.items() if key != said}


def _prompt(words: str, assumed: str) -> str:
    return str(typer.prompt(words, default=assumed, err=True)).strip()


def _answer(question: Question, answers: dict[str, Any]) -> Any:
    """The checked answer of a person."""
    from rig.new.asked import as_typed  # noqa: PLC0415

    why = f"{question.why}; ? lists ports, ? ADDRESS asks there who it is" if question.port else question.why
    if question.port and any(key.endswith("_at") for key in answers):
        why = "as before"
    err.print(f"\n[bold]{escape(question.ask)}[/] [dim]{escape(why)}[/]", soft_wrap=True)
    for number, (name, words) in enumerate(question.choices(answers).items(), 1):
        err.print(f"  {number:>2} {escape(name)}  [dim]{escape(words)}[/]", no_wrap=True, overflow="ellipsis")
    assumed = as_typed(question.default(answers))
    while True:
        said = _prompt(" ", assumed)
        if question.port and said.startswith("?"):
            from rig.new.wires import who_is_there  # noqa: PLC0415

            for line in who_is_there(said.removeprefix("?").strip()):
                err.print(f"  {escape(line)}", soft_wrap=True)
            continue
        try:
            return question.check(said, answers)
        except ValueError as error:
            err.print(f"[yellow]{escape(str(error))}[/]", soft_wrap=True)
