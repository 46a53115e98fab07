"""Whether the runs of a loop are those that its program file names: by their heads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from rig.errors import RigError
from rig.loop.program import Program
from rig.run_file.damage.audit import Finding
from rig.run_file.read.reader import RunReader


def findings_of_runs(program: Program) -> Iterator[Finding]:
    """Runs and files that are missing, or are others than those that the program file names."""
    for run in program.runs:
        if run.ended is None or not run.ended.head:
            continue
        path = program.file_of(run)
        try:
            with RunReader.open(path) as reader:
                if not any(own.hex() == run.ended.head for _, _, _, own in reader.chained()):
                    yield Finding("head", f"{path.name} has no record with the head that the loop noted of it")
        except RigError as error:
            yield Finding("head", f"{path.name}, run {run.planned.number} of the loop: {str(error).split('. ', 1)[0]}")
    for what in program.wrote.values():
        for name, sha256 in what.files.items():
            file = program.path.parent / Path(name)
            if not file.exists():
                yield Finding("file", f"{name}, the {what.status} of the loop, is missing")
            elif hashlib.sha256(file.read_bytes()).hexdigest() != sha256:
                yield Finding("file", f"{name} is not the {what.status} that the loop wrote")
