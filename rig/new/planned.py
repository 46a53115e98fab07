"""The plan of first files, before they are written: `rig plan` says the same of them in their folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from rig.errors import RigError
from rig.new.answers import Answers
from rig.new.files import BENCH, PROCEDURE, REGISTER, limits
from rig.procedures.present.blocks import Block, Line
from rig.verbs.plan.for_people import of_certificate
from rig.verbs.plan.result import Plan, plan

if TYPE_CHECKING:
    from rig.engine.session import Progress


def before_run(answers: Answers) -> list[str]:
    """Sentences on what nobody was asked, and has to be seen to before a run."""
    ends = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in limits(answers).items())
    return [
        f"the limits in {BENCH} are made of the levels ({ends}): set them to what bench and sensors stand",
        f"for a certificate, fill in {REGISTER} before the run: a run keeps the register as it is when it begins",
    ]


def planned(files: Mapping[str, str], on_progress: Callable[[Progress], None]) -> tuple[Plan, list[Block]]:
    """The plan of these files, and what is shown of it.

    Args:
        files: texts by name.
        on_progress: called with the progress of the rehearsal.

    Raises:
        RigError: they make no run; the message says why.
    """
    with TemporaryDirectory(prefix="rig-new-") as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        try:
            found = plan(folder / PROCEDURE, folder / BENCH, out=Path(), on_progress=on_progress)
        except RigError as error:
            error.args = (str(error).replace(f"{folder}/", ""),)
            raise
        blocks = list(found.blocks())
    later = {one.text for one in of_certificate(found)}
    shown = [one for one in blocks if not (isinstance(one, Line) and one.text in later)]
    if later:
        shown.append(Line("  a certificate needs more, most of it in equipment.toml: `rig plan` lists it"))
    return found, shown
