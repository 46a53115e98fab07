"""Files of a loop, written at its end beside its program file: the calibration, a certificate, the report."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rig.errors import RigError
from rig.fitter.errors import FitError
from rig.lab import laboratory_of
from rig.loop.page import loop_page
from rig.loop.program import Program
from rig.procedures.errors import DataError
from rig.procedures.present.shell import shell_word
from rig.register import DOCUMENT
from rig.run_file.events.loops import LoopWrote
from rig.runs.certificate_fields import SETTINGS
from rig.tables import FileSource
from rig.verbs.certificate.issue import Issue, check_extras, issue
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import make
from rig.verbs.confirm import Confirmed
from rig.verbs.data.result import fit_source
from rig.verbs.write_page import write_page

_FOLDER = "certificates"
REFUSALS = (RigError, DataError, FitError)


def calibration(program: Program) -> LoopWrote:
    """Write `NAME.calibration.json`: the first run with its further replications, with the causes that the further runs
    confirmed. Raises `UsageError` if the disk refuses.
    """
    first, *added = program.segments
    try:
        fitted = fit_source(FileSource(first), {}, (), program.further, keep=True, added=added)
    except REFUSALS as error:
        return LoopWrote(what="calibration", why=str(error))
    path = program.path.with_name(f"{program.name}.calibration.json")
    fitted.save(path)
    return LoopWrote(what="calibration", files=_hashes([path]))


def report(program: Program, confirmed: Confirmed | None) -> LoopWrote:
    """Write `NAME.html`, the report of the whole loop. Raises `UsageError` if the disk refuses."""
    path = program.path.with_name(f"{program.name}.html")
    write_page(path, loop_page(program, confirmed))
    return LoopWrote(what="report", files=_hashes([path]))


def certificate_settings(program: Program) -> Path | None:
    """The laboratory's settings for certificates beside the bench file; None if there are none, or no register."""
    path = Path(program.bounds.files["bench"].path).with_name(SETTINGS)
    return path if DOCUMENT in program.documents and path.exists() else None


def certificate(program: Program, settings: Path, utc_s: float) -> LoopWrote:
    """Issue a certificate of the first run with the confirmed effects, or say why there is none.

    One that was issued before this session was cut is taken as it is; a loop that was continued amends its earlier one.
    A dry loop issues none, because the numbers are those of real certificates; it says whether one would be.
    """
    if laboratory_of(settings) is not None and not program.run.simulated:
        command = f"rig certificate {shell_word(program.file_of(program.runs[0]))} --out {_FOLDER} --login LOGIN"
        return LoopWrote(what="certificate", why=f"an approver signs it with a password: {command}")
    out = program.path.with_name(_FOLDER)
    first, *added = program.segments
    head = program.runs[0].ended.head if program.runs[0].ended is not None else ""
    earlier = [path for path in sorted(out.glob("*.json")) if head and head in path.read_text(encoding="utf-8")]
    if earlier and not program.continued:
        return LoopWrote(what="certificate", files=_hashes(earlier[-1].parent.glob(f"{earlier[-1].stem}.*")))
    how = Issue(out)
    if earlier:
        how = Issue(out, amends=earlier[-1].stem, because="the loop was continued with further runs")
    day = datetime.fromtimestamp(utc_s, UTC).date()
    try:
        more: dict[str, Any] = {"confirmed_by": tuple(program.further), "added": tuple(added)}
        made = make(CertificateRequest((first,), day, settings=settings, **more))
        if program.run.simulated:
            count = sum(len(one.results) for one in made.document.tables)
            return LoopWrote(what="certificate", why=f"not issued of a simulated loop; one would have {count} results")
        check_extras(how)
        issued = issue(made, how)
    except REFUSALS as error:
        return LoopWrote(what="certificate", why=str(error))
    return LoopWrote(what="certificate", files=_hashes(issued.files), about={"number": issued.document.number})


def _hashes(paths: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of files by their names, those of certificates with their folder."""
    return {
        f"{path.parent.name}/{path.name}" if path.parent.name == _FOLDER else path.name: hashlib.sha256(
            path.read_bytes()
        ).hexdigest()
        for path in sorted(paths)
    }


def errors_before_after(program: Program) -> dict[str, tuple[float, float]]:
    """Error of both models on the further runs, by sensor: declared, with the effects."""
    last = program.found.get(program.complete)
    if last is None or not last.before:
        return {}
    return {name: (last.before[name], last.with_effects[name]) for name in last.before if name in last.with_effects}
