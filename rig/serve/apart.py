"""A slow act in a process of its own: the act as JSON on standard input, what came of it on standard output."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

from rig.acts import Act, Places, Told, act_of
from rig.errors import RigError, UsageError
from rig.lab import Laboratory
from rig.procedures.errors import DataError
from rig.who import Operator

_MOST_S, _MOST_BRIEF_S = 7200.0, 60.0


def apart(act: Act, laboratory: Laboratory, by: Operator) -> Told:
    """Do an act in a process that ends what it began, even if this one is killed. Raises `RigError`."""
    values = act.model_dump(exclude_none=True)
    asked = {"act": act.name, "values": values, "by": [by.name, by.by], "folder": str(laboratory.folder)}
    most_s = _MOST_BRIEF_S if act.brief else _MOST_S
    try:
        done = subprocess.run(
            [sys.executable, "-m", "rig.serve.apart"],
            input=json.dumps(asked),
            capture_output=True,
            text=True,
            timeout=most_s,
            start_new_session=True,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise UsageError(f"{act.name} took more than {most_s:.0f} s, and was ended") from None
    try:
        told = json.loads(done.stdout)
    except ValueError:
        raise RigError(f"a defect of rig: {done.stderr.strip()[-500:]}") from None
    if "error" in told:
        raise UsageError(told["error"])
    return Told(**told)


def main() -> None:
    """Do it; an error for people is an answer, too."""
    asked = json.load(sys.stdin)
    with contextlib.redirect_stdout(sys.stderr):  # nothing else is the answer
        try:
            act = act_of(asked["act"], asked["values"])
            told = asdict(act.carry_out(Places(Laboratory(Path(asked["folder"]))), Operator(*asked["by"])))
        except (RigError, DataError) as error:
            told = {"error": str(error)}
    print(json.dumps(told, default=str))


if __name__ == "__main__":
    main()
