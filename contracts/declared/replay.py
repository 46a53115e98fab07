"""Questions and answers of an instrument's file, as printed in its manual: whether the file itself reads them."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.forms import Form
from rig.contracts.declared.instrument import Instrument

_FUNCTIONS = {1: "coil", 2: "discrete", 3: "holding", 4: "input", 5: "coil", 6: "holding", 16: "holding"}


def known(table: Instrument, question: str) -> tuple[str, Ask | Tell] | None:
    """The question or command of the file that a line, or the bytes of a Modbus request in hexadecimal, is.

    Returns:
        Its place in the file, and itself; None if there is none.
    """
    every: list[tuple[str, Ask | Tell]] = [*table.asks(), *table.tells()]
    if table.modbus:
        request = bytes.fromhex(question)
        address = struct.unpack(">H", request[1:3])[0] + table.wire.first_register
        wanted = Tell if request[0] in (5, 6, 16) else Ask
        for place, one in every:
            if isinstance(one, wanted) and (one.register_, one.table) == (address, _FUNCTIONS.get(request[0])):
                return place, one
        return None
    for place, one in sorted(every, key=lambda found: "{" in (_line(found[1]) or "")):
        line = _line(one)
        if line is None and not question:
            return place, one
        if line is not None and Form(line).filled(table.parameters).read(question, strict=False) is not None:
            return place, one
    return None


def _line(one: Ask | Tell) -> str | None:
    return one.ask if isinstance(one, Ask) else one.tell


def replayed(table: Instrument) -> Iterator[str]:
    """Examples of a file that it does not understand itself, as sentences."""
    if table.can:
        from rig.contracts.declared.dbc import read_dbc, wrong_examples  # noqa: PLC0415 - few benches have a bus

        yield from wrong_examples(read_dbc(table.wire.dbc), table.examples)
        return
    for question, answer in table.examples:
        if question == table.errors.ask:
            if not _fits(table, table.errors.answer, answer):
                yield f"{answer!r} is no answer to {question!r} as in errors.answer"
            continue
        found = known(table, question)
        if found is None:
            yield f"{question!r} is not in the file"
            continue
        place, one = found
        if table.modbus:
            data = bytes.fromhex(answer)
            if data[:1] != bytes.fromhex(question)[:1] or (isinstance(one, Ask) and len(data) != 2 + data[1]):
                yield f"{answer!r} is no answer to {question!r}"
        elif not answer:
            if isinstance(one, Ask) or one.answer:
                yield f"{question!r} has no answer in examples, and one in {place}"
        elif place == "identity" and any(
            Form(form).filled({"maker": table.maker} if table.maker else {}).otherwise(answer.strip())
            for form in (one.forms if isinstance(one, Ask) else ())
        ):
            yield f"{answer!r} can be split by its form in identity in two ways: write what is always so as text"
        elif not _fits(table, (one.forms if isinstance(one, Ask) else one.answer) + table.errors.replies, answer, one):
            yield f"{answer!r} is no answer to {question!r} as in {place}"


def _fits(table: Instrument, forms: tuple[str, ...], answer: str, one: Ask | Tell | None = None) -> bool:
    words = {**table.words, **(one.words if isinstance(one, Ask) else {})}
    return any(Form(form, frozenset(words)).filled(table.parameters).read(answer.strip()) is not None for form in forms)
