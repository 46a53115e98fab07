"""Defects of an instrument's file, in words, and where a manual has what is missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rig.contracts.declared.exchanges import MEANINGS, Ask, Tell
from rig.contracts.declared.forms import Form
from rig.contracts.declared.wire import Wire

WHERE = {
    "identity": "a question that tells it from others; in the manual: identification, `*IDN?`, version",
    "reading": "a question for a reading; in the manual: remote commands, reading, measure, transmit weight",
    "unit": "unit of its quantity, such as degC; in the manual: specifications, units",
    "low": "lowest setpoint; in the manual: specifications, range",
    "high": "highest setpoint; in the manual: specifications, range",
    "set": "a command with {value}; in the manual: remote commands, setpoint",
    "setpoint": "a question for the setpoint, so that it is read back, or read with tolerance; in the manual: remote "
    "commands, setpoint",
    "safe": "a safe state: off with output, or safe_value; in the manual: output, standby, control on and off, vent",
    "settled": "how it has arrived: settled, or read with tolerance, or dwell_s; in the manual: status, stability",
    "register": "number of the register; in the manual: Modbus parameters, address",
    "dbc": "name of its DBC, a file beside this one; in the manual: CAN matrix, messages and signals",
}
"""Required keys: their meaning, and where a manual has it."""


def unknown_words(place: str, given: Mapping[str, str]) -> Iterator[str]:
    """Words of an answer without a meaning that is known."""
    for word, meaning in given.items():
        if meaning.partition(":")[0] not in MEANINGS:
            yield f"{place}: {word} is {meaning!r}; known: {', '.join(MEANINGS)}, or `error: TEXT`"


def wrong_numbers(place: str, given: Mapping[str, str], kind: str) -> Iterator[str]:
    """Words of a register that are numbers which it cannot have, or not in decimals; `kind` is its type of number."""
    bits = int(kind[-2:]) if kind != "bit" else 1
    low = -(1 << bits - 1) if kind.startswith("int") else 0
    for word in given:
        try:
            number = int(word, 0) if (coded := word[:2].lower() == "0x") else float(word)
        except ValueError:
            yield f"{place}: {word} is no number; a register has numbers"
            continue
        if kind == "float32":
            if coded:
                yield f"{place}: {word} is a code; a register of type float32 has numbers, NaN, inf or -inf: write that"
            continue
        own = number - (1 << bits) if low and (1 << bits - 1) <= number < 1 << bits else number
        if not low <= own < low + (1 << bits):
            yield f"{place}: {word} is outside {low} to {low + (1 << bits) - 1}, the numbers of type {kind}"
        elif coded or own != number:
            yield f"{place}: a register of type {kind} has {word} as {own:.0f}; write {own:.0f}"


def unknown_fields(skip: Iterable[str]) -> Iterator[str]:
    """Forms of lines that are passed over which are none, or name a field."""
    for text in skip:
        try:
            if not Form(text).literal:
                yield f"wire.skip: {text!r} would pass over every line"
            elif Form(text).fields:
                yield f"wire.skip: {text!r} names a field; write {{}} for any text"
        except ValueError as error:
            yield f"wire.skip: {error}"


def wrong_frames(wire: Wire, own: Mapping[str, str], parameters: Mapping[str, str | float]) -> Iterator[str]:
    """Frames of lines that make no sense; `own` are those of single lines, by place."""
    answers = [form for form in wire.reply if "{line}" in form] or [" or ".join(wire.reply)]
    every = [("wire.request", wire.request), *own.items(), *(("wire.reply", form) for form in answers)]
    for place, form in every:
        if "{line}" not in form:
            yield f"{place} = {form!r} lacks {{line}}"
        elif "{checksum" in form and wire.checksum is None:
            yield f"{place} has {{checksum}}, and wire.checksum does not say which"
    if wire.checksum is not None and "{checksum" not in "".join(form for _, form in every):
        yield "wire.checksum: neither wire.request nor wire.reply has {checksum}"
    if wire.checksum is not None and wire.checksum.kind == "crc" and not wire.checksum.polynomial:
        yield "wire.checksum: a crc needs its polynomial, or the name of one that is known"
    try:
        wire.frames(parameters)
        for form in own.values():
            wire.framed(form, parameters)
    except ValueError as error:
        yield f"wire: {error}"
    if wire.by_frame and not wire.reply_end and any(form.endswith("{line}") for form in wire.reply):
        yield f"wire.reply = {wire.reply[0]!r} does not tell where an answer ends: give it an end, or wire.reply_end"
    if wire.by_frame and (wire.protocol == "stream" or wire.echo):
        yield "wire: a stream or an echo needs lines that end with a character of their own"


def wrong_places(place: str, one: Ask | Tell, *, modbus: bool) -> Iterator[str]:
    """Where decimals are no register of registers, or no field of an answer."""
    if one.places and one.decimals is None:
        yield f"{place}: places are codes of decimals, which is missing: the register or field that has the code"
    if one.decimals is not None and modbus != isinstance(one.decimals, int):
        yield f"{place}: decimals = {one.decimals!r} has to be {'a register' if modbus else 'a field of its answer'}"
    elif isinstance(one.decimals, str):
        forms = one.forms if isinstance(one, Ask) else ()
        if not forms or any("{value" in form and f"{{{one.decimals}" not in form for form in forms):
            yield f"{place}: no field {one.decimals} in its answer, {' or '.join(forms) or 'which a command has not'}"
    for code, places in one.places.items():
        if not code.isdecimal() or not 0 <= places <= 9:
            yield f"{place}.places: {code} = {places} is no code with a number of decimals"


def wrong_forms(place: str, one: Ask | Tell, line: str | None, parameters: Mapping[str, object]) -> Iterator[str]:
    """Lines and answers of a question or a command that are no forms."""
    known = {"value", "count", "channel", "mark", *parameters}
    try:
        for name in (*Form(line or "").fields, *Form(getattr(one, "request", None) or "").fields):
            if name not in known:
                yield f"{place}: {{{name}}} is no parameter; parameters are {', '.join(parameters) or 'none'}"
        if place == "source.set" and line is not None and isinstance(one, Tell) and "value" not in Form(line).fields:
            return  # a command of the sequence
        for form in one.forms if isinstance(one, Ask) else one.answer:
            Form(form)
    except ValueError as error:
        yield f"{place}: {error}"


def said(error: Any) -> str:
    """An error of a table's check."""
    place = ".".join(map(str, error["loc"]))
    text = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        text = "is no key here"
    return f"{place}: {text}" if place else text
