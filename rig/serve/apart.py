"""A slow act in a process of its own: the act as JSON on standard input, what came of it on standard output."""

from __future__ import annotations

import contextlib
import json
import sys
from dataclasses import asdict
from pathlib import Path

from rig.acts import Places, act_of
from rig.errors import RigError
from rig.lab import Laboratory
from rig.procedures.errors import DataError
from rig.who import Operator


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
