"""Who measured a run, with which instruments and standards, for reports and calibration files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rig.run_file.events.sessions import Identified, SessionBegan
from rig.run_file.read.reader import RunReader
from rig.run_file.state.documents import Stored


def operators_of(reader: RunReader) -> list[str]:
    """Operators of the sessions, each once, if known."""
    began = (record.event for record in reader.records(SessionBegan.kind))
    return list(dict.fromkeys(event.by for event in began if isinstance(event, SessionBegan) and event.by))


def _calibration(documents: Mapping[str, str], asset: str, due: Any) -> str:
    """The calibration of an instrument in words: its certificate by the run's register, and the due date.

    The bench may state a date, too; without one it is that of the register.
    """
    certificate = Stored.of(documents, "equipment.toml").table("equipment").table(asset).table("certificate")
    number = certificate.text("number")
    due = due or certificate.everything().get("due", "not declared")
    return f"{f'certificate {number}, ' if number else ''}calibration due {due}"


def instruments_of(reader: RunReader, documents: Mapping[str, str]) -> dict[str, str]:
    """Identities of the instruments, and due dates of their own calibrations, by name."""
    found: dict[str, str] = {}
    for event in (record.event for record in reader.records(Identified.kind)):
        assert isinstance(event, Identified)
        name = event.instrument
        text = f"{event.words}, {_calibration(documents, event.asset or '', event.due)}"
        found[name] = f"{found[name]}; then {text}" if name in found else text
    return found


def standards_of(bench: Stored, documents: Mapping[str, str]) -> str:
    """Reference standards as declared: asset, certificate, due date, formula; "" without any.

    A standard without an asset of its own is the instrument that reads it.
    """
    told = []
    for factor, table in bench.table("references").tables():
        asset = table.text("asset") or bench.table("instruments").table(table.text("reader")).text("asset")
        parts = [
            f"asset {asset or 'not declared'}",
            _calibration(documents, asset, table.everything().get("due")),
            f"read by {table.text('reader')}",
            *([f"{factor} = {formula}"] if (formula := table.text("formula")) else []),
        ]
        told.append(f"{factor}: {', '.join(parts)}")
    return "; ".join(told)
