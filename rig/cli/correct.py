"""`rig correct`: another value for an entry that a person typed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.bench.typed import typed_columns
from rig.cli.commands import app
from rig.cli.options import OperatorOption, RunArgument
from rig.cli.show import err
from rig.errors import ExitCode, UsageError
from rig.files.regular import read_regular_text
from rig.procedures.present.shell import shell_word
from rig.run_file.chain import Record, encode
from rig.run_file.events.event import EMPTY
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.run_file.state.corrected import correction
from rig.run_file.state.state import read_state
from rig.run_file.write.writer import RunWriter
from rig.runs.certificate_fields import SETTINGS
from rig.runs.plans import stored_plan
from rig.verbs.certificate.numbers_issued import numbers_issued
from rig.verbs.certificate.settings import read_settings
from rig.who import operator

_LONGEST = 500
_MOST_TEXT = 20_000_000


@app.command()
def correct(
    run_file: RunArgument,
    entry: Annotated[str, typer.Argument(help="NAME=VALUE, in the typed unit", show_default=False)],
    point: Annotated[int, typer.Option(min=0, help="index of the point, run_index in tables", show_default=False)],
    why: Annotated[str, typer.Option(help="the reason, one sentence; it is part of the record", show_default=False)],
    reading: Annotated[
        int | None, typer.Option(min=1, help="which of several entries at that point, from 1", show_default=False)
    ] = None,
    after: Annotated[
        list[str] | None,
        typer.Option(help="number of a certificate that was issued of the run; repeatable", show_default=False),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            help="settings of certificates, whose register says what was issued",
            show_default="certificate.toml of the working folder",
        ),
    ] = None,
    operator_name: OperatorOption = None,
) -> int:
    """Correct an entry that a person typed; both values stay in the run file, with the reason and the name.

    Only typed readings can be corrected, of a run at which no controller works. Tables, fits and certificates use the
    corrected value, and say so.

    Examples:

    - `rig correct runs/20260115T180000-night-1a2b.sqlite gauge_bar=12.3 --point 7 --why "digits exchanged"`
    - `rig correct RUN gauge_bar=12.3 --point 7 --reading 2 --why "read twice"`
    - `rig correct RUN mass_g=100.02 --point 3 --after C-2026-0147 --why "wrong mass"`
    """
    why, who = why.strip(), operator(operator_name).name
    if not why or len(why) > _LONGEST or not why.isprintable():
        raise UsageError(f"--why: a reason has 1 to {_LONGEST} printable characters")
    if not run_file.is_file():
        raise UsageError(f"there is no run file {run_file}")
    from rig.drivers.clock import RealClock  # noqa: PLC0415

    if controller_alive(run_file):
        raise UsageError(
            f"a controller is at work on {run_file}: correct the entry when the run has ended, or after "
            f"`rig stop {shell_word(run_file)}`"
        )
    with RunReader.open(run_file) as reader:
        plan, state, head = stored_plan(reader, run_file, None), read_state(reader), reader.head()
        columns = typed_columns(plan.bench, plan.procedure.conduct)
        whole_plot, event = correction(reader, columns, point, entry, reading)
        missing = sorted((_issued(reader, run_file) | _registered(reader, settings)) - set(after or ()))
    if missing:
        raise UsageError(
            f"certificate {', '.join(missing)} was issued of this run, and would no longer state what the run says. "
            f"Say that you know it, {' '.join(f'--after {shell_word(one)}' for one in missing)}; then amend it: "
            f"rig certificate {shell_word(run_file)} --amends {shell_word(missing[0])}"
        )
    event = replace(event, why=why, who=who, after=after or EMPTY)
    now_s, body = RealClock().utc(), encode(event.body())
    record = Record(state.sessions, event.kind, state.elapsed_s, now_s, point, whole_plot, body=body)
    with RunWriter.open(run_file) as run:
        if run.written != head:
            raise UsageError(f"{run_file} has got other records meanwhile; nothing was recorded, try again")
        run.correct(record, ended=state.ended is not None)
        now = run.written[1].hex()
    err.print(f"{escape(event.sentence(record))}; head {now}", soft_wrap=True)
    return ExitCode.DONE


def _registered(run: RunReader, given: Path | None) -> set[str]:
    """Numbers of certificates of the run by the laboratory's register of issued ones."""
    settings = given or Path(SETTINGS)
    if given is None and not settings.exists():
        return set()
    folder = settings.absolute().parent
    with numbers_issued(folder / read_settings(settings).numbers, folder) as issued:
        return {one.number for one in issued.of_runs([run.about().run_id])}


def _issued(run: RunReader, run_file: Path) -> set[str]:
    """Numbers of certificates beside the run, or in `certificates` there, that name one of its heads."""
    heads = {own.hex() for _, _, _, own in run.chained()}
    folders = (run_file.absolute().parent, run_file.absolute().parent / "certificates", Path("certificates").absolute())
    found = set()
    for path in {path for folder in folders if folder.is_dir() for path in folder.glob("*.json")}:
        text = read_regular_text(path, _MOST_TEXT)
        if '"head"' in text and any(head in text for head in heads):
            found.add(path.stem)
    return found
