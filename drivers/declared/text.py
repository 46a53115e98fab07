"""Lines of text, as an instrument's file has them: filled in, put into their frame, and read by their forms."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.forms import TEXTS, Form, step_of
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.sums import Frame
from rig.contracts.declared.units import same_unit
from rig.drivers.clock import Clock
from rig.drivers.declared.lines import LinesTalk
from rig.drivers.declared.talk import NOTHING, Answer, Holes
from rig.drivers.errors import BadReply, InstrumentError, NoReply
from rig.drivers.scpi import agrees, forget_errors
from rig.drivers.wires import Wires
from rig.drivers.wires.serial_options import LineSettings

_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]*)?")
_PERIODS = 3  # a line that is torn, one that is lost, and one more
_MOST_ERRORS = 32  # chosen: a queue that does not end is a garbled answer


@dataclass(slots=True)
class _Compiled:
    """A question or command with its forms made once, and the last answer: settings are answered alike."""

    of: Ask | Tell
    request: Form
    fixed: str | None
    answers: tuple[Form, ...]
    frame: Frame | None
    last: tuple[str, Answer] | None = None


class TextTalk(LinesTalk):
    """An instrument that takes lines of text, with the meaning of its answers; arguments and errors as `LinesTalk`."""

    def __init__(
        self,
        table: Instrument,
        name: str,
        address: str,
        settings: LineSettings,
        parameters: Mapping[str, str | float],
        wires: Wires,
        clock: Clock,
    ) -> None:
        super().__init__(table, name, address, settings, parameters, wires, clock)
        self._compiled: dict[int, _Compiled] = {}
        self._refusals = [self._form(text) for text in table.errors.replies]
        self._errors = [self._form(text) for text in table.errors.answer]
        self._skipped = [self._form(text) for text in table.wire.skip]

    def _forms(self, one: Ask) -> tuple[str, ...]:
        """Forms of the answer to a question."""
        return one.forms

    def _of(self, one: Ask | Tell) -> _Compiled:
        """A question or command with its forms; they are made at its first use."""
        found = self._compiled.get(id(one))
        if found is None:
            if isinstance(one, Ask):
                words, forms, line = frozenset({**self.table.words, **one.words}), self._forms(one), one.ask
            else:
                words, forms, line = frozenset(), one.answer, one.tell
            request = self._form(line or "")
            fixed = None if request.fields else request.write({})
            frame = self.table.wire.framed(one.frame, self._parameters) if one.frame is not None else None
            found = _Compiled(one, request, fixed, tuple(self._form(form, words) for form in forms), frame)
            self._compiled[id(one)] = found
        return found

    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """Ask once, or twice if no answer comes and `repeat`."""
        compiled = self._of(ask)
        line = compiled.fixed if compiled.fixed is not None else compiled.request.write(holes)
        if ask.ask is None:
            return self.read(ask, self._heard(compiled.answers), holes)
        try:
            raw = self._query(line, ask.lines, timeout_s or ask.timeout_s, compiled.frame, repeat=repeat)
        except NoReply:
            first = self.table.identity.ask if self.table.identity is not None else None
            # before it is known, it is asked nothing else
            if self.table.errors.each and line not in (self.table.errors.ask, first):
                with contextlib.suppress(NoReply, BadReply):
                    self.raise_errors(line)
            raise
        found = self.read(ask, raw, holes)
        if self.watches:
            self._nothing_more(ask.said, raw, ask.lines)
        return found

    def _heard(self, wanted: Sequence[Form]) -> str:
        """The first line that begins from now on and is not to be skipped, of an instrument that talks by itself."""
        self._begin()
        wire = self.table.wire
        limit = wire.timeout_s + _PERIODS * wire.period_s
        end = self.clock.now() + limit
        line = self._unframed("its lines", self.line.heard(limit))
        while _of_one(wanted, line) is None and _of_one(self._skipped, line, f"{line} ") is not None:
            try:
                line = self._unframed("its lines", self.line.heard(max(end - self.clock.now(), 0.0), onwards=True))
            except NoReply:
                said = f"{self.where} sends only lines that its file skips for {limit:g} s, last {line!r}"
                raise NoReply(said) from None
        return line

    def read(self, ask: Ask, raw: str, holes: Holes = NOTHING) -> Answer:
        """The meaning of an answer. Raises `BadReply`, `InstrumentError`."""
        compiled = self._of(ask)
        if compiled.last is not None and compiled.last[0] == raw:
            return compiled.last[1]
        said, raw = raw, self._parsed(ask, raw)
        for form in compiled.answers:
            fields = form.read(raw)
            if fields is not None:
                if ask is self.table.identity:
                    fields = self._only(ask, form, fields, raw)
                found = self._meaning(ask, form, fields, raw, holes)
                if not holes and not self.hooks:
                    compiled.last = said, found
                return found
        self._refused(ask.said, raw)
        raise self.bad(ask, raw, " or ".join(f"an answer as in {text!r}" for text in self._forms(ask)))

    def _only(self, ask: Ask, form: Form, fields: dict[str, str], raw: str) -> dict[str, str]:
        """The fields of an identity. Raises `BadReply` if its text can be split in two ways."""
        maker = self.table.maker
        by_maker = form.filled({"maker": maker}) if maker else form  # it is known, also one with a space
        found = by_maker.read(raw)
        if found is not None and by_maker is not form:
            form, fields = by_maker, {**found, "maker": maker}
        other = form.otherwise(raw)
        if other is None:
            return fields
        first, second = (" and ".join(f"{name} {one[name]!r}" for name in other) for one in (fields, other))
        written = form.text.replace("{model}", self.table.model[0])
        raise self.bad(
            ask,
            raw,
            f"one way to read it by {form.text!r}, and it may be {first}, or {second}: write what is always so as "
            f"text, such as answer = {written!r}",
        )

    def _parsed(self, ask: Ask, raw: str) -> str:
        """An answer as the hook of the file gives it. Raises `BadReply` if the hook does not."""
        parse = self.hooks.get("parse")
        if parse is None:
            return raw
        try:
            found = parse(ask.ask or "", raw)
        except Exception as error:  # whatever somebody's code raises
            raise self.bad(
                ask, raw, f"what parse in {self.table.hook} reads ({type(error).__name__}: {error})"
            ) from None
        if not isinstance(found, str):
            raise self.bad(ask, raw, f"a text from parse in {self.table.hook}, not {found!r}")
        return found

    def _refused(self, said: str, raw: str) -> None:
        """Raise `InstrumentError` if an answer means one."""
        for form in self._refusals:
            fields = form.read(raw)
            if fields is not None:
                raise self._error(f"{self.where}, after {said!r},", fields.get("code", ""), fields.get("text", ""), raw)

    def _error(self, where: str, code: str, text: str, raw: str) -> InstrumentError:
        words = self.table.errors.codes.get(code) or self.table.errors.codes.get(code.lstrip("+0")) or text.strip('" ')
        number = int(code) if code.lstrip("+-").isdecimal() else 0
        return InstrumentError(where, number, words or f"it refuses ({raw})")

    def _meaning(self, ask: Ask, form: Form, fields: Mapping[str, str], raw: str, holes: Holes) -> Answer:
        value, meaning, printed = math.nan, "", raw
        words = ask.words or self.table.words
        for name, text in fields.items():
            field = form.fields[name]
            if name == ask.field and (name == "value" or text not in words):
                printed = text
                number = self._number(ask, form, raw, text)
                meaning = meaning or (self.meant(ask, text, number, holes) if words else "")
                if ask.asks_bit:
                    meaning = ask.of_bit(number)
                value = ask.quantity(number) if ask.decimals is None else self._quantity(ask, form, fields, number)
                self.printed[id(ask)] = text, value
            elif name == "unit":
                self._same_unit(ask, raw, text)
            elif name in holes:
                if not agrees(text, holes[name]):
                    raise self.bad(ask, raw, f"{name} {holes[name]}: this is another one's answer")
            elif words and not field.number and name not in TEXTS:
                said = self.meant(ask, text, float(text) if _NUMBER.fullmatch(text) else None, holes)
                if not said and name.startswith("state"):
                    raise self.bad(ask, raw, f"one of its words: {', '.join(words)}")
                meaning = meaning or said
                printed = text if ask.field not in fields or name == ask.field else printed
        if ask.field not in fields and len(fields) == 1:
            printed = next(iter(fields.values()))
        return Answer(fields, value, meaning, printed)

    def _number(self, ask: Ask, form: Form, raw: str, text: str) -> float:
        field = form.fields[ask.field]
        try:
            return field.read(text, signed=ask.signed)
        except ValueError:
            raise self.bad(ask, raw, "a number") from None

    def value_of(self, ask: Ask, field: str, found: Answer) -> float:
        """The number in another field of an answer, as quantity. Raises `BadReply`."""
        form = next(form for form in self._of(ask).answers if field in form.fields)
        try:
            number = form.fields[field].read(found.fields[field], signed=ask.signed)
        except ValueError:
            raise self.bad(ask, found.fields[field], f"a number as {field}") from None
        value = self._quantity(ask, form, found.fields, number)
        self.printed[id(ask)] = found.fields[field], value
        return value

    def _quantity(self, ask: Ask, form: Form, fields: Mapping[str, str], number: float) -> float:
        """A number as quantity, with the decimals that another field of its answer says. Raises `BadReply`."""
        value = ask.quantity(number)
        if isinstance(ask.decimals, str) and ask.decimals in fields:
            said = fields[ask.decimals]
            try:
                value *= 10.0 ** -ask.places_of(form.fields[ask.decimals].read(said))
            except ValueError as error:
                raise self.bad(ask, said, f"as {ask.decimals} its decimals ({error})") from None
        return value

    def _same_unit(self, ask: Ask | Tell, raw: str, printed: str) -> None:
        table = self.table
        declared = [part.unit for part in (table.reader, table.source) if part is not None and part.unit]
        if table.reader is not None:
            declared += [one.unit for one in table.reader.channels.values() if one.unit]
        if not any(same_unit(printed, unit) or table.units.get(printed) == unit for unit in declared):
            raise self.bad(ask, raw, f"a number in {' or '.join(declared)}; was its unit changed at the panel?")

    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Send a command; if `checked`, look whether it was refused. Never repeated."""
        compiled = self._of(tell)
        line = compiled.fixed if compiled.fixed is not None else compiled.request.write(holes)
        if tell.answer:
            self._acknowledged(tell, compiled, line, holes)
        else:
            self._write(line, compiled.frame)
        self.waits(tell)
        if checked:
            self.raise_errors(line)

    def _acknowledged(self, tell: Tell, compiled: _Compiled, line: str, holes: Holes) -> None:
        """Send a command that has an answer. Raises `InstrumentError`, `NoReply`, `BadReply`: it took another value."""
        raw = self._query(line, 1, None, compiled.frame, repeat=False)
        form, fields = next(((form, f) for form in compiled.answers if (f := form.read(raw)) is not None), (None, {}))
        if form is None:
            self._refused(line, raw)
            raise self.line.bad_reply(line, raw, " or ".join(map(repr, tell.answer)))
        if "unit" in fields:
            self._same_unit(tell, raw, fields["unit"])
        if "value" in fields and "value" in holes:
            told = compiled.request.fields["value"]
            sent = told.read(str(told.write(holes["value"])), signed=tell.signed)
            took = form.fields["value"].read(fields["value"], signed=tell.signed)
            if abs(took - sent) > step_of(fields["value"]) * 1.000001:  # it may print fewer digits than it was sent
                raise self.line.bad_reply(line, raw, f"the value that it was told: it took {took:g} and not {sent:g}")
        if self.watches:
            self._nothing_more(tell.said, raw)

    def raise_errors(self, line: str = "") -> None:
        """Ask for errors. Raises `InstrumentError` with the first; the others are in its text."""
        errors, found = self.table.errors, []
        if errors.ask is None:
            return
        where = f"{self.where}, after {line!r}," if line else self.where
        for _ in range(_MOST_ERRORS if errors.queue else 1):
            raw = self._query(errors.ask, 1, None, repeat=False)
            fields = next((f for form in self._errors if (f := form.read(raw)) is not None), None)
            code = (fields or {}).get("code", "")
            odd = errors.none.isdecimal() and code not in errors.codes and "." in code  # readings, and not an error
            if fields is None or odd:
                raise self.line.bad_reply(errors.ask, raw, f"an answer as in {errors.answer[0]!r}")
            if self.watches:
                self._nothing_more(errors.ask, raw)
            if errors.bits:
                mask = int(code) if code.lstrip("+").isdecimal() else 0
                words = [text for bit, text in errors.bits.items() if mask >> int(bit) & 1]
                found += [InstrumentError(where, mask, " and ".join(words))] if words else []
                break
            if code == errors.none or (errors.none.isdecimal() and agrees(code, float(errors.none))):
                break
            found.append(self._error(where, code, fields.get("text", ""), raw))
        if found:
            first, *others = found
            raise InstrumentError(where, first.code, first.text + "".join(f"; then {e.code} {e.text}" for e in others))

    def forget_errors(self) -> None:
        """Empty the error queue of errors that are nobody's; an answer that makes no sense is left for later."""
        if self.table.errors.ask is not None:
            forget_errors(self.raise_errors, self.line)


def _of_one(forms: Sequence[Form], *lines: str) -> Form | None:
    """The first form that one of some lines has."""
    return next((form for form in forms if any(form.read(line) is not None for line in lines)), None)
