"""Lines of an instrument's file that are sent before anything is known of it: its identity, and one to synchronise."""

from __future__ import annotations

from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import Instrument


def question_of(table: Instrument) -> str:
    """The question for its identity as it is sent, in its frame and with its end, by the parameters of its file."""
    assert table.identity is not None
    wire, asked = table.wire, table.identity
    line, frames = Form(asked.ask or "").filled(table.parameters).write({}), wire.frames(table.parameters)
    framed = line if frames is None else frames[0].write(line)
    return wire.with_reads(framed, asked.lines) + wire.send_end


def sync_of(table: Instrument) -> tuple[str, str] | None:
    """A question for synchronisation, and a text in all its answers: the identity, if it says enough."""
    identity = table.identity
    if identity is None or identity.ask is None or "{" in identity.ask:
        return None
    known = {"maker": table.maker, "model": table.model[0]} if len(table.model) == 1 else {}
    literal = Form(identity.forms[0]).filled(known).literal if len(identity.forms) == 1 else ""
    if not literal and known and all("{model}" in form for form in identity.forms):
        literal = table.model[0]
    return (identity.ask, literal) if len(literal) >= 2 else None
