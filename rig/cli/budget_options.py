"""Options of commands that know a register of equipment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

EquipmentOption = Annotated[
    Path | None,
    typer.Option(
        "--equipment",
        help="a register of equipment, for runs that were made without one or with another one",
        show_default="the register kept with the run",
    ),
]
SameMeterOption = Annotated[
    bool,
    typer.Option(
        "--same-meter",
        help="the meter of the run reads the sensors in use, too: errors that it has in both cancel",
    ),
]
