"""`rig night` and `rig study`: commands of the package `proving`, which is in the source and not in the wheel."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, NoReturn

import typer

import rig
from rig.cli.commands import app
from rig.errors import UsageError

_COMMANDS = {
    "night": ("proving.command_night", "Simulate nights with faults, crashes and power cuts."),
    "study": ("proving.command_study", "Reproduce published work, and compare with the printed results."),
}


def _is_here() -> bool:
    """Whether the package `proving` is the one beside `rig`."""
    spec = find_spec("proving")
    beside = Path(str(rig.__file__)).parent.parent
    return spec is not None and spec.origin is not None and Path(spec.origin).parent.parent == beside


def _register_absent(name: str, does: str) -> None:
    @app.command(
        name,
        help=f"{does} Not in this installation: it comes with the source.",
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    )
    def absent(
        context: typer.Context, rest: Annotated[list[str] | None, typer.Argument(hidden=True)] = None
    ) -> NoReturn:
        raise UsageError(
            f"rig {name} belongs to the proving ground, which is not part of the installed package: "
            f"get the project's source, run `make test` there once, and then .venv/bin/rig {name}"
        )


for _name, (_module, _does) in _COMMANDS.items():
    if _is_here():
        import_module(_module)
    else:
        _register_absent(_name, _does)
