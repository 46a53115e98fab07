"""`rig seal`: a signature or a time stamp over a run file and the certificates made from it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption, OperatorOption, RunArgument
from rig.cli.show import err, mark, out, print_json
from rig.errors import ExitCode, RunFileError, UsageError


@app.command()
def seal(
    run_file: RunArgument,
    key: Annotated[
        Path | None, typer.Option(help="private Ed25519 key, PEM without a password", show_default=False)
    ] = None,
    certificate: Annotated[
        list[Path] | None,
        typer.Option("--certificate", help="certificate made from the run, sealed too; repeatable", show_default=False),
    ] = None,
    statement: Annotated[
        Path | None,
        typer.Option(help="write the bytes that an authority has to stamp, and seal nothing yet", show_default=False),
    ] = None,
    time_stamp: Annotated[
        Path | None, typer.Option(help="answer of the authority after RFC 3161", show_default=False)
    ] = None,
    operator_name: OperatorOption = None,
    as_json: JsonOption = False,
) -> int:
    """Seal a run file and its certificates: a signature by a key, or the time stamp of an authority.

    The run file is verified first and is not changed; the seals are in `RUN.seal` beside it, and `rig verify RUN` shows
    them. Making a key: `openssl genpkey -algorithm ed25519 -out lab.pem`.

    Examples:

    - `rig seal runs/20260115T180000-night-1a2b.sqlite --key lab.pem --certificate K-2026-0147.pdf`
    - `rig seal RUN --statement RUN.statement`
    - `rig seal RUN --time-stamp RUN.tsr`
    """
    from rig.drivers.clock import RealClock  # noqa: PLC0415
    from rig.files.atomic import check_files, write_whole_bytes  # noqa: PLC0415
    from rig.run_file.read.reader import RunReader  # noqa: PLC0415
    from rig.run_file.verify.verification import verify_file  # noqa: PLC0415
    from rig.verbs.certificate.seals import Sealed, beside, hash_of, stamp, statement_to_stamp  # noqa: PLC0415
    from rig.verbs.certificate.seals import seal as sealed_by  # noqa: PLC0415
    from rig.who import operator  # noqa: PLC0415

    if sum(one is not None for one in (key, statement, time_stamp)) != 1:
        raise UsageError("name one of --key KEY.pem, --statement FILE and --time-stamp FILE")
    files = certificate or []
    check_files([statement], [run_file, key, time_stamp, *files])
    found = verify_file(run_file)
    if not found.whole:
        raise RunFileError(f"{run_file} is not sealed, for it is not whole: {found.findings[0]}; see rig verify")
    if len({one.name for one in files}) < len(files):
        raise UsageError("two certificates have the same file name: a seal tells them by it")
    with RunReader.open(run_file) as reader:
        run_id = reader.about().run_id
    what = Sealed(run_id, found.records, found.head, {one.name: hash_of(one) for one in files})
    if statement is not None:
        write_whole_bytes(statement, lambda file: file.write(statement_to_stamp(what)))
        name = escape(str(statement))
        err.print(
            f"{name}: openssl ts -query -sha256 -cert -data {name} makes the question to an authority", soft_wrap=True
        )
        return ExitCode.DONE
    if key is not None:
        now = datetime.fromtimestamp(RealClock().utc(), UTC)
        made = sealed_by(run_file, what, key, operator(operator_name).name, now)
    else:
        assert time_stamp is not None
        made = stamp(run_file, what, time_stamp)
    if as_json:
        print_json({"file": str(beside(run_file)), **made})
    else:
        words = f"{escape(str(beside(run_file)))}: {found.records} records, head {found.head}, sealed {made['when']}"
        out.print(f"{mark(bool(found.simulated))}{words}", soft_wrap=True)
    return ExitCode.DONE
