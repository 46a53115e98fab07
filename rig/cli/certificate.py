"""`rig certificate`: certificates of runs, and digital certificates of others."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, date, datetime
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rig.cli.commands import app
from rig.cli.options import JsonOption
from rig.cli.show import err, mark, out, print_json
from rig.cli.signed_in import LoginOption, signed_in
from rig.cli.waiting import waiting
from rig.errors import ExitCode, UsageError
from rig.lab import laboratory_of
from rig.procedures.column_names import split_unit, unit_of
from rig.procedures.present.terminal import print_whole
from rig.units.differences import NOT_CELSIUS

if TYPE_CHECKING:
    from rig.dcc.read_dcc import Quantity, Read
    from rig.dcc.signature import Signed
    from rig.verbs.certificate.issue import Issue, Issued
    from rig.verbs.certificate.request import CertificateRequest


def _file(text: str) -> Any:
    return typer.Option(help=text, show_default=False)


@app.command()
def certificate(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(help="one run file, or CSV table; or two, as found and as left", show_default=False),
    ] = None,
    out_folder: Annotated[
        Path | None, typer.Option("--out", "-o", help="folder of the files", show_default=False)
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="what the laboratory settles once", show_default="certificate.toml of the working folder"),
    ] = None,
    equipment: Annotated[
        Path | None,
        typer.Option(help="a register of equipment", show_default="the one kept with the run; else equipment.toml"),
    ] = None,
    number: Annotated[
        str | None, typer.Option(help="number of the certificate", show_default="the next by the settings")
    ] = None,
    amends: Annotated[
        str | None,
        typer.Option(help="number of a certificate in the folder that this one replaces", show_default=False),
    ] = None,
    because: Annotated[
        str, typer.Option(help="why it is amended, or why there is a second one", show_default=False)
    ] = "",
    confirmed_by: Annotated[
        list[Path] | None, _file("a later run that confirms the effects found; repeatable: all are judged together")
    ] = None,
    ignore: Annotated[
        list[str] | None,
        typer.Option(
            help="column that the trace does not look at, as in rig trace; repeatable",
            show_default="what the later runs recorded",
        ),
    ] = None,
    added: Annotated[
        list[Path] | None, _file("a replication that a loop added to the last run; repeatable, in their order")
    ] = None,
    traced: Annotated[
        bool,
        typer.Option(
            "--traced",
            help="results of the model with the effects found; the default once further runs confirm all of them",
        ),
    ] = False,
    adjustment: Annotated[
        str, typer.Option(help="adjustment between as found and as left, a sentence", show_default=False)
    ] = "",
    room: Annotated[
        list[str] | None,
        typer.Option(
            help="what the laboratory's own record says of the room, lowest and highest value: humidity_pct=38..46; "
            "repeatable",
            show_default=False,
        ),
    ] = None,
    calibrated_by: Annotated[
        str, typer.Option(help="who calibrated", show_default="the settings, or the operators")
    ] = "",
    approved_by: Annotated[str, typer.Option(help="who approves", show_default="the settings")] = "",
    issued: Annotated[str, typer.Option(help="date of issue, YYYY-MM-DD", show_default="today")] = "",
    template: Annotated[Path | None, _file("own template of the page, in typst")] = None,
    paper: Annotated[str, typer.Option(help="a4 or letter", show_default="the settings")] = "",
    key: Annotated[Path | None, _file("private key, PEM, that signs the digital certificate")] = None,
    key_certificate: Annotated[Path | None, _file("X.509 certificate of the key, PEM")] = None,
    schema: Annotated[Path | None, _file("PTB's schema, by which the digital certificate is checked")] = None,
    read: Annotated[Path | None, _file("show a digital certificate, also one of others, and its signatures")] = None,
    authority: Annotated[
        Path | None, _file("with --read: certificates, PEM, of trusted signers or authorities")
    ] = None,
    as_equipment: Annotated[
        str | None,
        typer.Option(help="with --read: print the entry of this asset for equipment.toml", show_default=False),
    ] = None,
    quantity: Annotated[
        str, typer.Option(help="with --as-equipment: column or unit of the readings, bath_degC", show_default=False)
    ] = "",
    error: Annotated[
        str | None, typer.Option(help="its values in the certificate, if they are errors", show_default=False)
    ] = None,
    correction: Annotated[
        str | None, typer.Option(help="its values in the certificate, if they are corrections", show_default=False)
    ] = None,
    at: Annotated[str, typer.Option(help="the settings of these values in the certificate", show_default=False)] = "",
    column: Annotated[
        list[str] | None,
        typer.Option(
            help="with --read: print these values as a table for rig fit: bath_degC=basic_referenceValue; repeatable",
            show_default=False,
        ),
    ] = None,
    login: LoginOption = None,
    as_json: JsonOption = False,
) -> int:
    """Certificate of a run: on paper (PDF), as a page (HTML), and as digital calibration certificate (XML).

    It has the results with expanded uncertainties by the register of equipment, the budgets, the conditions, the
    equipment, statements of conformity, and the effects found. It is refused, with all reasons at once and exit code 2,
    if a due date had passed, the run is not verified or not complete, the name of an effect is doubtful and no further
    run has settled it, a field is missing, or an uncertainty is repeatability only. An effect that no further run has
    confirmed is stated as such. For a CSV table, [table] in the settings says what a run file would say; the
    certificate says what remains unknown. A certificate is never overwritten: --amends makes one that
    replaces it.

    Examples:

    - `rig certificate RUN --out certificates`
    - `rig certificate FOUND LEFT --adjustment "zero set" --out certificates`
    - `rig certificate --read DCC.xml`
    """
    if read is not None:
        if runs:
            raise UsageError("--read shows a certificate and makes none: leave out the run files")
        if as_equipment is not None:
            return _print_equipment(read, as_equipment, quantity, (error, correction), at, authority)
        if column:
            return _print_table(read, column, authority)
        return _read(read, schema, authority, as_json=as_json)
    if as_equipment is not None or column:
        raise UsageError("--as-equipment and --column belong to --read DCC.xml")
    if not runs or out_folder is None:
        raise UsageError(
            "a certificate needs a run or a table, and --out FOLDER: rig certificate RUN --out certificates"
        )
    from rig.files.atomic import check_files  # noqa: PLC0415
    from rig.verbs.certificate.issue import Issue, all_files, check_extras  # noqa: PLC0415
    from rig.verbs.certificate.request import CertificateRequest  # noqa: PLC0415
    from rig.verbs.certificate.standing_sentences import LACKS  # noqa: PLC0415

    later = tuple(confirmed_by or ())
    people = (calibrated_by, approved_by)
    asked = CertificateRequest(
        tuple(runs), _date(issued), equipment, settings, later, *people, adjustment, _date(""), traced, _room(room),
        tuple(added or ()), tuple(ignore or ()),
    )  # fmt: skip
    how = Issue(out_folder, number or "", amends or "", because, template, paper, key, key_certificate, schema)
    check_files([], list(all_files(asked, how)))
    check_extras(how)
    made = _issued(asked, how, login)
    if as_json:
        print_json(made.to_json())
        return ExitCode.DONE
    count = sum(len(one.results) for one in made.document.tables)
    simulated = mark(made.document.simulated)
    out.print(f"{simulated}certificate {escape(made.document.number)}: {count} results", soft_wrap=True)
    for path in made.files:
        out.print(f"  {escape(str(path))}", soft_wrap=True)
    for name in made.discarded:
        words = f"certificate {name} was cut while it was written, and never issued: its files were removed"
        err.print(f"  [yellow]{escape(words)}[/]", soft_wrap=True)
    if any(LACKS in one for one in made.document.models):
        words = (
            "results are of the declared model, which lacks effects that were found: --traced states those with them"
        )
        err.print(f"  [yellow]{words}[/]", soft_wrap=True)
    for change in made.document.amends.changes if made.document.amends else ():
        err.print(f"  amended: {escape(change)}", soft_wrap=True)
    return ExitCode.DONE


def _issued(asked: CertificateRequest, how: Issue, login: str | None) -> Issued:
    """The certificate, issued; in a laboratory with people an approver gives the password again."""
    from rig.verbs.certificate.issue import issue  # noqa: PLC0415
    from rig.verbs.certificate.result import make  # noqa: PLC0415
    from rig.verbs.certificate.signing import issue_signed  # noqa: PLC0415

    laboratory = laboratory_of(asked.runs[0])
    if laboratory is None:
        if login is not None:
            raise UsageError(f"--login {login}: {asked.runs[0]} is in no laboratory with people (rig person)")
        with waiting("certificate"):
            document = make(asked)
        return issue(document, how)
    approver = signed_in(laboratory, login, "approver")
    with waiting("certificate"):
        return issue_signed(laboratory, approver, asked, how)


def _room(given: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """Lowest and highest values by name with unit. Raises `UsageError`."""
    found: dict[str, tuple[float, float]] = {}
    for one in given or ():
        name, _, values = one.partition("=")
        ends = values.partition("..")
        try:
            low, high = (float(text) for text in (ends[0], ends[2] if ends[1] else ends[0]))
        except ValueError:
            low, high = 1.0, 0.0
        if not (all(split_unit(name)) and isfinite(low) and isfinite(high) and low <= high):
            raise UsageError(f"--room {one}: say a quantity with its unit and two numbers, humidity_pct=38..46")
        unit = unit_of(name)
        if unit in NOT_CELSIUS:
            raise UsageError(f"--room {one}: state a temperature in degC")
        if any(unit_of(other) == unit for other in found):
            raise UsageError(f"--room {one}: the room has one value in {unit} already: state the whole range at once")
        found[name] = low, high
    return found


def _date(text: str) -> date:
    if not text:
        from rig.drivers.clock import RealClock  # noqa: PLC0415

        return datetime.fromtimestamp(RealClock().utc(), UTC).date()
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise UsageError(f"--issued {text} is no date such as 2026-11-24") from None


def _read(path: Path, schema: Path | None, authority: Path | None, *, as_json: bool) -> int:
    """Show a digital calibration certificate. Exit code 1 if a signature or the schema does not hold."""
    from rig.dcc.read_dcc import as_json as json_of  # noqa: PLC0415
    from rig.dcc.read_dcc import bytes_of, parsed  # noqa: PLC0415

    data = bytes_of(path)
    found = parsed(data, str(path))
    signed = _signatures(path, found, authority)
    errors: list[str] = []
    if schema is not None:
        from rig.dcc.ptb_schema import schema_errors  # noqa: PLC0415

        errors = schema_errors(data, schema)
    if as_json:
        print_json({**json_of(found), "signatures": [vars(one) for one in signed], "schema_errors": errors})
    else:
        _show(found, signed, errors, checked=schema is not None)
    return ExitCode.FAULT if errors or any(not one.holds or one.trusted is False for one in signed) else ExitCode.DONE


def _print_equipment(
    path: Path, asset: str, quantity: str, values: tuple[str | None, str | None], at: str, authority: Path | None
) -> int:
    """Print an entry for equipment.toml from a digital calibration certificate."""
    from rig.dcc.read_dcc import read_dcc  # noqa: PLC0415
    from rig.register.from_dcc import Wanted, choose, equipment_text  # noqa: PLC0415
    from rig.verbs.certificate.seals import hash_of  # noqa: PLC0415

    means = choose(values)
    if not quantity:
        raise UsageError("name the column or unit of the readings: --quantity bath_degC")
    wanted = Wanted(asset, quantity, next(one for one in values if one is not None), means, at)
    found = read_dcc(path)
    state = _usable(path, found, authority)
    print(equipment_text(found, wanted, hash_of(path)), end="")
    err.print(f"{escape(str(path))}: {escape(state)}", soft_wrap=True)
    by_hand = "the due date, the conditions (holds_at = ...), and how the error behaves (behaves = ...)"
    err.print(f"  add {by_hand}, by hand", soft_wrap=True)
    return ExitCode.DONE


def _print_table(path: Path, columns: Sequence[str], authority: Path | None) -> int:
    """Print values of a digital calibration certificate as CSV."""
    from rig.dcc.read_dcc import read_dcc  # noqa: PLC0415
    from rig.register.from_dcc import Column, table_text  # noqa: PLC0415

    wanted = []
    for one in columns:
        name, is_given, value = one.partition("=")
        if not (name.strip() and is_given and value.strip()):
            raise UsageError(f"--column {one}: say a column and values of the certificate, bath_degC=NAME")
        wanted.append(Column(name.strip(), value.strip()))
    found = read_dcc(path)
    state = _usable(path, found, authority)
    print(table_text(found, wanted), end="")
    err.print(f"{escape(str(path))}: {escape(state)}", soft_wrap=True)
    for text in found.untraceable[:1]:
        err.print(f"  [yellow]it says that it is not traceable: {escape(text)}[/]", soft_wrap=True)
    err.print(
        "  uncertainties of a certificate are mostly common to its rows; rig fit --u-y takes them as independent, and "
        "intervals by it are then too narrow",
        soft_wrap=True,
    )
    return ExitCode.DONE


def _usable(path: Path, found: Read, authority: Path | None) -> str:
    """State of its signature, in words. Raises `UsageError` if it does not hold or is not trusted."""
    signed = _signatures(path, found, authority)
    broken = next((one for one in signed if not one.holds or one.trusted is False), None)
    if broken is not None:
        raise UsageError(f"nothing is taken from {path}: its signature {broken.words}")
    return f"signature {signed[0].words}" if signed else "not signed: nothing shows whether it was changed"


def _signatures(path: Path, found: Read, authority: Path | None) -> tuple[Signed, ...]:
    """Signatures of a digital certificate, verified; () if it has none."""
    if not found.signatures:
        return ()
    from rig.dcc.read_dcc import bytes_of  # noqa: PLC0415
    from rig.dcc.signature import signatures  # noqa: PLC0415
    from rig.drivers.clock import RealClock  # noqa: PLC0415

    return signatures(bytes_of(path), datetime.fromtimestamp(RealClock().utc(), UTC), authority)


def _show(found: Read, signed: tuple[Signed, ...], errors: list[str], *, checked: bool) -> None:
    from rich.table import Table  # noqa: PLC0415

    out.print(
        f"[bold]{escape(found.number)}[/] (DCC {escape(found.version)}): {escape(found.laboratory)}", soft_wrap=True
    )
    dates = [("calibrated", found.began), ("to", found.ended), ("issued", found.issued)]
    said = ", ".join(f"{name} {when}" for name, when in dates if when is not None)
    for line in (f"for {found.customer}" if found.customer else "", *found.items, said):
        if line:
            out.print(f"  {escape(line)}", soft_wrap=True)
    for one in signed:
        out.print(f"  [{'green' if one.holds else 'bold red'}]signature {escape(one.words)}[/]", soft_wrap=True)
    if not signed:
        out.print("  [yellow]not signed: nothing shows whether it was changed[/]")
    for text in found.untraceable[:1]:
        out.print(f"  [yellow]it says that it is not traceable: {escape(text)}[/]", soft_wrap=True)
    for error in errors:
        out.print(f"  [bold red]schema: {escape(error)}[/]", soft_wrap=True)
    if checked and not errors:
        out.print("  valid by the schema")
    table = Table("part", "quantity", "value", "expanded uncertainty", "k", "probability", "unit")
    for quantity in found.quantities:
        for row in _rows(quantity):
            table.add_row(*(escape(cell) for cell in row))
    print_whole(table, out)
    for what, word in found.conformity:
        out.print(f"  conformity: {escape(what)}: [bold]{escape(word)}[/]", soft_wrap=True)


def _padded(value: float, expanded: float | None) -> str:
    """A value as it was stated, with the zeros at its end that its uncertainty has digits for: a number lost them."""
    text, digits = f"{value!r}", "" if expanded is None else f"{expanded:.10g}"
    places = len(digits.partition(".")[2])
    return text if "e" in text + digits or len(text.partition(".")[2]) >= places else f"{value:.{places}f}"


def _rows(quantity: Quantity) -> list[tuple[str, ...]]:
    if not quantity.numbers:
        return [(quantity.where, quantity.name, quantity.text, "", "", "", "")] if quantity.text else []
    return [
        (
            quantity.where,
            quantity.name + (f" [{n}]" if len(quantity.numbers) > 1 else ""),
            _padded(one.value, one.expanded),
            *("-" if number is None else f"{number:.10g}" for number in (one.expanded, one.k, one.probability)),
            one.unit,
        )
        for n, one in enumerate(quantity.numbers, 1)
    ]
