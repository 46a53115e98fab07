"""Twins of instruments that are tables: one class is made of each file."""

from __future__ import annotations

from functools import cache
from typing import Any

from rig.contracts.declared.instrument import parse
from rig.sims.declared.behaviour import Behaviour
from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import ERROR_QUEUE
from rig.sims.faults.reading_faults import OF_READINGS


@cache
def twin_of(text: str) -> type[Behaviour]:
    """The twin of an instrument's file. Raises `ValueError` with all that is wrong with the file."""
    table = parse(text)
    base: type[Behaviour]
    if table.modbus:
        from rig.sims.declared.registers import RegistersTwin  # noqa: PLC0415 - few benches have one

        base = RegistersTwin
    elif table.can:
        from rig.sims.declared.frames import FramesTwin  # noqa: PLC0415

        base = FramesTwin
    else:
        from rig.sims.declared.lines import LinesTwin  # noqa: PLC0415

        base = LinesTwin
    faults: tuple[Kind, ...] = OF_READINGS if table.reader is not None else ()
    faults += (ERROR_QUEUE,) if table.errors.ask is not None and table.errors.queue and table.lines else ()
    members: dict[str, Any] = {
        "table": table,
        "wire": table.wire.protocol if table.modbus or table.can else "serial",
        "roles": frozenset(role for role in ("reader", "source") if getattr(table, role) is not None),
        "faults": faults,
    }
    return type("DeclaredTwin", (base,), members)
