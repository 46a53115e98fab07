"""The table of a declared instrument, checked: everything that its role lacks is named at once."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, JsonValue, ValidationError, model_validator

from rig.contracts.declared.bridges import PATTERN, bridged, completed
from rig.contracts.declared.defects import (
    WHERE,
    said,
    unknown_fields,
    unknown_words,
    wrong_forms,
    wrong_frames,
    wrong_numbers,
    wrong_places,
)
from rig.contracts.declared.exchanges import Ask, Check, Strict, Tell, Tells, Texts
from rig.contracts.declared.forms import Form
from rig.contracts.declared.hooks import Function, hooks
from rig.contracts.declared.options import (
    computed,
    filled,
    named,
    with_value,
    wrong_answers,
    wrong_choices,
    wrong_formulas,
    wrong_values,
)
from rig.contracts.declared.roles import Mark, Reader, Source, Unit
from rig.contracts.declared.scan import Scan
from rig.contracts.declared.wire import Errors, Identity, Wire

Tried = Literal["twin only", "foreign client", "foreign simulator", "on hardware"]


STAND_IN = "stand-in"
"""What a table is about that stands in a dry run for an instrument without a twin."""


class Instrument(Strict):
    """A whole file."""

    bridge: str = Field(
        "",
        pattern=PATTERN,
        description="driver of another library that reaches it: questions are attributes of it, commands set them",
    )
    arguments: dict[str, JsonValue] = Field({}, description="of a bridge: what its class takes besides")
    hook: str = Field("", description="Python file beside this one with parse, settled or say, for what no key says")
    hook_sha256: str = Field("", description="of the hook; written when the file is read")
    maker: str = Field("", description="maker, as it spells itself")
    model: Texts = Field((), description="model; of a family all models that answer alike")
    about: str = Field("", description="what it is, for the list")
    sources: Texts = Field((), description="manuals, with page or chapter of each claim")
    tried: Annotated[tuple[Tried, ...], Field(description="how it was tried")] = ()
    unconfirmed: Texts = Field((), description="what no source states")
    in_python: bool = Field(False, description="its role is in Python, in a class that inherits from that of this file")
    scpi: bool = Field(
        False, description="it has *IDN?, SYST:ERR? and *ESE, so that identity, errors and mark may be left out"
    )
    parameters: dict[str, str | int | float] = Field(
        {}, description="what the bench file may set, with its default: {node}"
    )
    optional: dict[str, str] = Field(
        {},
        description="numbers that the bench file may give, with their meaning: `ramp`; commands that prepare it and "
        "settings with {ramp} are left out where it does not",
    )
    choices: dict[str, tuple[str | int | float, ...]] = Field(
        {}, description="all values that a parameter may have, or baud or frame of the wire"
    )
    formulas: dict[str, str] = Field(
        {}, description="numbers of the reader that follow from parameters: `2 * nplc / line_Hz + 0.001 * (nplc < 1)`"
    )
    asked: dict[str, Ask] = Field(
        {}, description="parameters that it is asked for after preparing, and formulas then follow: its line frequency"
    )
    wire: Wire = Wire()
    identity: Identity | None = Field(None, description="who it is")
    words: dict[str, str] = Field({}, description="words of all answers; see Ask")
    units: dict[str, Unit] = Field({}, description="its spelling of units: `g/h` is g_per_h")
    errors: Errors = Errors()
    prepare: Tells = Field((), description="commands that prepare it; a source is not switched by them")
    check: tuple[Check, ...] = Field((), description="settings: asked after preparing, before and after every point")
    healthy: tuple[Check, ...] = Field((), description="what is so without a fault; asked likewise")
    ready: tuple[Check, ...] = Field(
        (), description="what is so while its setpoint is ours, such as no program: asked before every setting, too"
    )
    mark: Mark | None = Field(None, description="how it is known that the power was off; left out: by check")
    local: Tells = Field((), description="commands at the end that give the panel back")
    reader: Reader | None = None
    source: Source | None = None
    scan: Scan | None = None
    examples: tuple[tuple[str, str], ...] = Field(
        (), description="questions and answers as printed in the manual, or recorded; tests replay them"
    )

    @model_validator(mode="before")
    @classmethod
    def _standard(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("bridge"):
            return completed(given)
        if not isinstance(given, dict) or not given.get("scpi"):
            return given
        prepared = {"tell": ["*PSC 1", "*ESE 52"], "check": {"ask": "*ESE?", "is": 52}}
        return {"identity": {"ask": "*IDN?"}, "errors": {"ask": "SYST:ERR?"}, "mark": prepared, **given}

    @property
    def hooks(self) -> Mapping[str, Function]:
        """Functions of its hook, {} without one; this runs its code. Raises `ValueError`."""
        return hooks(self.hook, self.hook_sha256) if self.hook else {}

    def chosen(self, options: Mapping[str, Any]) -> Instrument:
        """The table of one instrument: its parameters, and what follows from them, as a bench file has them."""
        own = {name: type(default)(options.get(name, default)) for name, default in self.parameters.items()}
        own |= {name: float(options[name]) for name in self.optional if options.get(name) is not None}
        found: dict[str, Any] = {"parameters": own}
        left = self.optional.keys() - own.keys()
        found |= {key: filled(named(getattr(self, key), left), own) for key in ("check", "healthy", "ready")}
        found["prepare"] = tuple(with_value(one, own) for one in named(self.prepare, left))
        if self.reader is not None:
            numbers = self.computed(own)
            if self.scan is not None:
                tells, checks, numbers["channels"] = self.scan.chosen(options, own)
                found |= {"prepare": (*found["prepare"], *tells), "check": (*found["check"], *checks)}
            found["reader"] = self.reader.model_copy(update=numbers)
        return self.model_copy(update=found)

    def computed(self, parameters: Mapping[str, str | float]) -> dict[str, Any]:
        """Numbers of the reader that follow from parameters, by its key."""
        return {key: computed(text, parameters) for key, text in self.formulas.items()}

    @property
    def any_model(self) -> bool:
        """Whether its maker and model are whatever the library of a bridge says."""
        return bool(self.bridge) and self.model == (bridged(self.bridge).model,)

    @property
    def modbus(self) -> bool:
        """Whether it has registers, not lines."""
        return self.wire.protocol == "modbus"

    @property
    def can(self) -> bool:
        """Whether it has messages, not lines."""
        return self.wire.protocol == "can"

    @property
    def lines(self) -> bool:
        """Whether it has lines of text, on a serial line of its own."""
        return not (self.modbus or self.can or self.bridge)

    @property
    def remembers(self) -> bool:
        """Whether it is known that its power was off."""
        return self.mark is not None or bool(self.check and self.prepare)

    @property
    def coarse(self) -> bool:
        """Whether its readings have a step that is declared, so that they may repeat to the last digit."""
        return self.step > 0.0

    @property
    def step(self) -> float:
        """Largest step of its readings that is declared; 0 if none is."""
        read = [self.source.read] if self.source is not None else []
        if self.reader is not None:
            read += [self.reader.reading, self.reader.fetch, *(one.reading for one in self.reader.channels.values())]
        own = self.reader.resolution if self.reader is not None else 0.0
        return max([own, *(self._step(ask) for ask in read if ask is not None)])

    def _step(self, ask: Ask) -> float:
        """Step of the number in an answer; 0 if it is finer than any."""
        if self.can:
            from rig.contracts.declared.dbc import find_signal, read_dbc, step_of  # noqa: PLC0415 - see _of_messages

            return abs(ask.scale) * step_of(find_signal(read_dbc(self.wire.dbc), "", ask.ask or "")[1])
        if self.modbus:
            return 0.0 if (ask.type or self.wire.type) == "float32" else abs(ask.scale)
        fields = [field for form in ask.forms for field in Form(form).fields.values() if field.name != "mark"]
        stepped = [f for f in fields if (f.decimals >= 0 and f.kind[:1] != "e") or f.kind in ("d", "x")]
        return max((abs(ask.scale) * 10.0 ** -max(field.decimals, 0) for field in stepped), default=0.0)

    def asks(self) -> Iterator[tuple[str, Ask]]:
        """All its questions, with their place in the file."""
        if self.identity is not None:
            yield "identity", self.identity
        if self.wire.done is not None:
            yield "wire.done", self.wire.done
        yield from ((f"asked.{name}", one) for name, one in self.asked.items())
        for name in ("check", "healthy", "ready"):
            yield from ((f"{name}[{n}]", one) for n, one in enumerate(getattr(self, name)))
        if self.mark is not None:
            yield "mark.check", self.mark.check
        for part, keys in (
            ("reader", ("reading", "confirm", "fetch")),
            ("source", ("setpoint", "read", "output", "settled")),
        ):
            table = getattr(self, part)
            for key in keys if table is not None else ():
                if getattr(table, key) is not None:
                    yield f"{part}.{key}", getattr(table, key)
        for name, channel in self.reader.channels.items() if self.reader is not None else ():
            if channel.reading is not None:
                yield f"reader.channels.{name}.reading", channel.reading

    @property
    def encoding(self) -> Literal["ascii", "latin-1", "utf-8"]:
        """How characters such as a degree sign are sent; Latin-1 has one byte for each."""
        if self.wire.encoding is not None:
            return self.wire.encoding
        every = [form for _, ask in self.asks() for form in ask.forms]
        every += [form for _, tell in self.tells() for form in tell.answer]
        return "ascii" if "".join((*every, *self.units, *self.words, *self.wire.reply)).isascii() else "latin-1"

    def tells(self) -> Iterator[tuple[str, Tell]]:
        """All its commands, with their place in the file."""
        found: list[tuple[str, tuple[Tell, ...]]] = [("prepare", self.prepare), ("local", self.local)]
        found += [("wire.remote", (Tell(tell=self.wire.remote),))] if self.wire.remote else []
        found += [("mark.tell", self.mark.tell)] if self.mark is not None else []
        if self.reader is not None:
            found += [(f"reader.{key}", getattr(self.reader, key)) for key in ("select", "start", "number", "abort")]
        if self.source is not None:
            found += [(f"source.{key}", getattr(self.source, key)) for key in ("set", "on", "off", "hold")]
        for name, several in found:
            yield from ((name, one) for one in several)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        wrong = list(self._lacking()) + list(self._wrong())
        if wrong:
            raise ValueError("; ".join(wrong) if len(wrong) == 1 else "".join(f"\n  - {one}" for one in wrong))
        return self

    def _lacking(self) -> Iterator[str]:
        if not self.model:
            yield "model is missing"
        if self.identity is None:
            yield f"identity is missing: {WHERE['identity']}"
        if self.reader is None and self.source is None and not self.in_python:
            yield "a role is missing: [reader] if it measures, [source] if it sets something"
        reader, source = self.reader, self.source
        if reader is not None:
            lacking = [key for key in ("unit", "reading") if getattr(reader, key) is None]
            own = reader.channels and all(one.reading is not None for one in reader.channels.values())
            if "reading" in lacking and (own or reader.fetch is not None):
                lacking.remove("reading")
            if "unit" in lacking and reader.channels and all(one.unit for one in reader.channels.values()):
                lacking.remove("unit")
            yield from (f"reader.{key} is missing: {WHERE[key]}" for key in lacking)
            if bool(reader.start) != (reader.fetch is not None):
                yield "reader.start and reader.fetch belong together"
        if source is not None:
            for key in ("unit", "low", "high"):
                if getattr(source, key) is None:
                    yield f"source.{key} is missing: {WHERE[key]}"
            if not source.set:
                yield f"source.set is missing: {WHERE['set']}"
            compared = source.read is not None and (source.tolerance is not None or self.hook)
            if source.setpoint is None and not any(one.answer for one in source.set) and not compared:
                yield f"source.setpoint is missing: {WHERE['setpoint']}"
            if source.safe_value is None and not source.off:
                yield f"source has no safe state: {WHERE['safe']}"

    def _wrong(self) -> Iterator[str]:
        yield from wrong_choices(self.choices, {"baud": self.wire.baud, "frame": self.wire.frame, **self.parameters})
        known = dict.fromkeys(self.optional, 0.0) | self.parameters
        yield from (f"optional.{name} is a parameter, too" for name in self.optional if name in self.parameters)
        yield from wrong_answers((*self.check, *self.healthy, *self.ready), known)
        yield from wrong_values((one for _, one in self.tells()), known)
        yield from (f"asked.{name}: there is no parameter {name}" for name in self.asked if name not in self.parameters)
        if self.scan is not None:
            yield from self.scan.wrong(self.parameters)
            if self.reader is None or self.reader.fetch is None:
                yield "scan needs [reader] with start and fetch"
        yield from wrong_formulas(self.formulas, self.parameters, reads=self.reader is not None)
        if self.hook and not self.lines:
            yield "hook is for lines of text, which neither registers nor messages nor a bridge have"
        if self.source is not None:
            yield from _of_source(self.source)
        key, other = ("register", "a line of text") if self.modbus else ("line of text", "a register")
        key = "signal or message" if self.can else key
        every: list[tuple[str, Ask | Tell]] = [*self.asks(), *self.tells()]
        for place, one in every:
            line = one.ask if isinstance(one, Ask) else one.tell
            listening = self.wire.protocol == "stream" and place.endswith(("reading", "identity"))
            if not listening and (one.register_ is None if self.modbus else line is None):
                yield f"{place} has no {key}{f', but {other}' * (line is not None or one.register_ is not None)}"
            if self.modbus and isinstance(one, Tell) and one.value is None and place != "source.set":
                yield f"{place} has no value to write"
            may_lack = place.startswith(("prepare", "check", "healthy", "ready"))
            yield from wrong_forms(place, one, line, known if may_lack else self.parameters)
            yield from wrong_places(place, one, modbus=self.modbus)
            if isinstance(one, Ask):
                yield from unknown_words(f"{place}.words", one.words)
                if self.modbus and place not in ("source.output", "source.settled"):
                    bit = one.type == "bit" or one.asks_bit or one.table in ("coil", "discrete")
                    kind = "bit" if bit else one.type or self.wire.type
                    yield from wrong_numbers(f"{place}.words", one.words, kind)
                if not self.can and (one.request is not None or one.status is not None):
                    yield f'{place}: request and status belong to protocol = "can"'
        if self.can:
            yield from _of_messages(self)
        elif own := sorted(_OF_MESSAGES & self.wire.model_fields_set):
            yield f'wire: {", ".join(own)} belong to protocol = "can"'
        yield from unknown_words("words", self.words)
        yield from unknown_fields(self.wire.skip)
        frames = {f"{place}.frame": one.frame for place, one in every if one.frame is not None}
        yield from wrong_frames(self.wire, frames, self.parameters)


_OF_LINES = frozenset(
    ("baud", "frame", "flow", "send_end", "reply_end", "echo", "preamble", "request", "reply", "checksum", "skip")
) | {"clear", "clear_drops_dtr", "remote", "done"}
"""Keys of the wire that messages do not have."""
_OF_MESSAGES = frozenset(("dbc", "cyclic", "counter", "identifiers_plus"))
"""Keys of the wire that nothing else has."""


def _of_messages(table: Instrument) -> Iterator[str]:
    """Where a file with CAN messages does not fit its DBC."""
    from rig.contracts.declared.dbc import read_dbc, wrong_messages  # noqa: PLC0415 - 0.2 s, and few benches have a bus

    wire, reader, source = table.wire, table.reader, table.source
    if foreign := sorted(_OF_LINES & wire.model_fields_set):
        yield f"wire: {', '.join(foreign)} belong to lines of text, not to messages"
    units: dict[str, str | None] = {}
    if reader is not None:
        units["reader.reading"] = reader.unit
        units |= {f"reader.channels.{name}.reading": one.unit or reader.unit for name, one in reader.channels.items()}
        if any(one.reading is None for one in reader.channels.values()):
            yield "reader.channels: each channel needs a reading of its own, its signal"
        if reader.fetch is not None or reader.start:
            yield "reader.start and reader.fetch are for lines of text; a signal that has to be asked for has a request"
    if source is not None:
        units |= dict.fromkeys(("source.set", "source.setpoint", "source.read"), source.unit)
    if wire.identifiers_plus and not isinstance(table.parameters.get(wire.identifiers_plus), int):
        yield f"wire.identifiers_plus: parameters has no whole number {wire.identifiers_plus!r}"
    if not wire.dbc:
        yield f"wire.dbc is missing: {WHERE['dbc']}"
        return
    if "\n" not in wire.dbc:
        yield f"wire.dbc = {wire.dbc!r} was not read: it has to be a DBC file beside this one"
        return
    try:
        database = read_dbc(wire.dbc)
    except ValueError as error:
        yield f"wire.dbc: {error}"
        return
    asks, tells = list(table.asks()), list(table.tells())
    if table.errors.ask is not None:
        asks.append(("errors", Ask(ask=table.errors.ask)))
    known = {one.name for one in database.messages}
    yield from (f"wire.cyclic: the DBC has no message {one!r}" for one in wire.cyclic if one not in known)
    if wire.counter and not any(wire.counter == signal.name for one in database.messages for signal in one.signals):
        yield f"wire.counter: no message of the DBC has a signal {wire.counter!r}"
    declared = {place: unit for place, unit in units.items() if unit is not None}
    yield from wrong_messages(database, asks, tells, declared, table.units, table.words)


def _with_steps(table: Instrument) -> Instrument:
    """A file with CAN messages, with the readback that the steps of its DBC allow."""
    source = table.source
    if source is None or source.readback is not None or source.setpoint is None:
        return table
    from rig.contracts.declared.dbc import read_dbc, step_of_value  # noqa: PLC0415

    step = max(source.step, *(step_of_value(read_dbc(table.wire.dbc), one) for one in source.set))
    readback = (step + table._step(source.setpoint)) * 0.5000001
    return table.model_copy(update={"source": source.model_copy(update={"readback": readback or None})})


def _of_source(source: Source) -> Iterator[str]:
    low, high = source.low, source.high
    if low is not None and high is not None:
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            yield f"source: low = {low:g} has to be below high = {high:g}, both finite"
        elif source.safe_value is not None and not low <= source.safe_value <= high:
            yield f"source.safe_value = {source.safe_value:g} is outside {low:g} to {high:g}"
    if source.output is None and (source.on or (source.off and source.safe_value is None)):
        yield "source.output is missing: on and off are read back by it; in the manual: output, status"
    if source.output is not None and not source.off:
        yield "source.off is missing: it belongs to output"
    if source.rest is not None and not (source.off and source.read is not None and source.read_off):
        yield "source.rest needs off, and read, which answers while it is off"
    if source.rest is not None and not source.rest[0] < source.rest[1]:
        yield f"source.rest = {list(source.rest)} has to be the lowest and the highest reading"
    if source.tolerance is not None and source.read is None:
        yield "source.tolerance needs read: it is how its reading tells that it has arrived"
    if source.readback is not None and source.readback < source.step / 2 * (1 - 1e-9):
        yield f"source.readback = {source.readback:g} is less than half the step of set, {source.step:g}"


def parse(text: str) -> Instrument:
    """The instrument of a file's text, TOML or JSON. Raises `ValueError` with all that is wrong."""
    values: dict[str, Any] = json.loads(text) if text.startswith("{") else tomllib.loads(text)
    try:
        found = Instrument.model_validate(values)
        return _with_steps(found) if found.can else found
    except ValidationError as error:
        raise ValueError("; ".join(said(one) for one in error.errors())) from None
