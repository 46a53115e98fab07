"""Check that the instruments are the ones a run began with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rig.engine.journal import Journal
from rig.errors import BenchFault
from rig.procedures.present.shell import shell_word
from rig.run_file.events.sessions import Identified

_WHO = ("maker", "model", "serial", "asset")


def compare_identities(
    journal: Journal, found: Mapping[str, dict[str, Any]], accept: frozenset[str], path: Path
) -> None:
    """Record the identities of the instruments, and refuse an exchanged instrument.

    Of a simulated run nothing is confirmed: simulators answer with the identities that they are given.

    Args:
        journal: where new identities are recorded.
        found: present identities, by name.
        accept: names of instruments that may have been exchanged.
        path: the run file, for the message.

    Raises:
        BenchFault: names the instrument and says how to go on.

    """
    simulated = journal.fold.simulated
    for name, told in found.items():
        now = {**told, "confirmed": told["confirmed"] and not simulated, "simulated": simulated}
        before = journal.fold.identities.get(name)
        if before is not None and all(before[key] == now[key] for key in _WHO):
            continue
        if before is not None and name not in accept:
            raise BenchFault(
                f"{name} is another instrument than before (was {_who(before)}; is {_who(now)}). Connect the first "
                f"one, or accept the new one as a new block of the data: rig resume "
                f"{shell_word(path)} --accept {shell_word(name)}"
            )
        journal.write(Identified(instrument=name, **now, replaces=before))


def _who(identity: Mapping[str, Any]) -> str:
    known = identity["confirmed"] or identity.get("simulated")
    serial = identity["serial"] if known else "no serial number"
    asset = f", asset {identity['asset']}" if identity["asset"] else ""
    return f"{identity['maker']} {identity['model']}, {serial}{asset}"
