"""Twin of a declared instrument on a line of text: it knows the lines of its file, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isnan
from typing import Any, NamedTuple

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.forms import Field, Form
from rig.sims.declared.behaviour import OVERLOAD, Behaviour, Refused, Said, places_of
from rig.sims.wires.serial_line import bits_per_character
from rig.sims.world import World

_COMMAND_S = 0.003  # time for one line [?]
_SILENCE_S = 0.2  # after it, what has come so far is no begin of a frame [?]
ENDS = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}
"""Ends of lines, by their names in a bench file."""
_PRINTED = {"degC": "C", "degF": "F", "pct": "%"}


class _Line(NamedTuple):
    """A line that it knows: its form, its place in the file, and what it is there."""

    form: Form
    place: str
    what: Ask | Tell | None


class LinesTwin(Behaviour):
    """The twin; see `rig.sims.twin.SerialTwin`."""

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self.table = self.table.chosen(options)  # type: ignore[misc]  # of one instance
        wire, self._hooks = self.table.wire, self.table.hooks
        self.baud = int(str(options.get("baud", wire.baud)))
        self.frame = str(options.get("frame", wire.frame))
        self._parameters: Mapping[str, str | float] = self.table.parameters
        self._send_end = ENDS.get(str(options.get("line_end", "")), wire.send_end.encode("ascii"))
        self._reply_end = wire.reply_end.encode("ascii") or self._send_end
        self._frames = wire.frames(self._parameters)
        self._utf8 = self.table.encoding == "utf-8"
        every = [*(ask.frame for _, ask in self.table.asks()), *(tell.frame for _, tell in self.table.tells())]
        own = dict.fromkeys(template for template in every if template is not None)
        self._own_frames = {template: wire.framed(template, self._parameters) for template in own}
        asked_by = [wire.read] if wire.read else []  # its answer has been sent by then
        self._lines = [_Line(self._form(line), "preamble", None) for line in (*wire.preamble, *asked_by)]
        for place, ask in self.table.asks():
            if ask.ask is not None:
                self._lines.append(_Line(self._line_form(ask.ask), place, ask))
        self._lines += [
            _Line(self._line_form(tell.tell), place, tell)
            for place, tell in self.table.tells()
            if tell.tell is not None
        ]
        self._lines.sort(key=lambda line: len(line.form.fields))  # whole lines before those with something to fill in
        self._whole = {line.form.write({}).casefold(): line for line in reversed(self._lines) if not line.form.fields}
        self._open = [line for line in self._lines if line.form.fields]
        self._error = self._form(self.table.errors.answer[0])
        self._forms: dict[tuple[int, str], Form] = {}
        self._session, self._input, self._free = 0, b"", 0.0
        self._came_at = 0.0
        self._host: Callable[[bytes], None] | None = None
        super().__init__(name, options, world, plant, serial)

    def _form(self, text: str) -> Form:
        return Form(text).filled(self._parameters)

    def _line_form(self, text: str) -> Form:
        """The form of a line; the colon before a SCPI command may be left out."""
        return self._form(text.removeprefix(":") if self.table.scpi else text)

    def switch_on(self) -> None:
        """State at power-on; a stream begins."""
        super().switch_on()
        self._session += 1
        self._input = b""
        self._talk_on()

    def connected(self, tx: Callable[[bytes], None]) -> None:
        """A host is there: it hears a stream."""
        begun, self._host = self._host is not None, tx
        if not begun:
            self._talk_on()

    def _talk_on(self) -> None:
        wire = self.table.wire
        if wire.protocol == "stream" and self._host is not None:
            self.world.call_in(wire.period_s, partial(self._say, self._session))

    def _say(self, session: int) -> None:
        if session == self._session and self._host is not None:
            others = [self._form(text).write({}) for text in self.table.wire.skip]
            for line in others:
                self._send(line, self._host, session)
            # it measures when the line of its reading begins
            on_their_way_s = (
                sum(bits_per_character(self.frame) * (len(line) + len(self._reply_end)) for line in others) / self.baud
            )
            self.world.call_in(on_their_way_s, partial(self._say_reading, session))

    def _say_reading(self, session: int) -> None:
        if session == self._session and self._host is not None:
            place, ask = next((place, ask) for place, ask in self.table.asks() if place.startswith("reader."))
            self._send(self._printed(ask, self.answers(place, ask, {}), {}), self._host, session)
            self._talk_on()

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Collect characters until a line ends; each line takes its time."""
        clear = self.table.wire.clear.encode("ascii")
        if clear and clear in data:
            data = data.rpartition(clear)[2].removeprefix(self._send_end)
            self._session, self._input, self._free = self._session + 1, b"", 0.0
            self.does("reader.abort", Tell(), {})
        if self.table.wire.by_frame:
            lines = self._whole_frames(data)
        else:
            *lines, self._input = (self._input + data).split(self._send_end)
        for line in lines:
            now = self.world.now()
            self._free = max(now, self._free) + _COMMAND_S
            self.world.call_in(self._free - now, partial(self._line, line.decode("latin-1"), tx, self._session))

    def _whole_frames(self, data: bytes) -> list[bytes]:
        """Frames whose end only their checksum tells; what comes after a silence is the begin of another one."""
        now, found = self.world.now(), []
        if now - self._came_at > _SILENCE_S:
            self._input = b""
        self._came_at = now
        for byte in data:
            self._input += bytes((byte,))
            text = self._input.removesuffix(self._send_end) if self._input.endswith(self._send_end) else b""
            if text and self._ends(text.decode("latin-1")):
                found.append(text)
                self._input = b""
        return found

    def _ends(self, text: str) -> bool:
        """Whether what has come is a whole frame: with an end, or else around a line that is known."""
        if self._unframed(text) is None:
            return False
        request = self.table.wire.request
        if self._own_frames or self._frames is None or (request.endswith("{line}") and not self._send_end):
            return self._of_its_frame(text) is not None or (
                self._frames is not None and not request.endswith("{line}") and self._frames[0].read(text) is not None
            )
        return True

    def _of_its_frame(self, text: str) -> str | None:
        """The line in a frame in which the file sends it; None if there is none."""
        for form, place, what in self._lines:
            template = what.frame if what is not None else None
            frame = self._own_frames[template] if template is not None else self._frames and self._frames[0]
            found = (text, "") if frame is None or place == "preamble" else frame.read(text)
            if found is None or found[1]:
                continue
            if any(form.read(one, strict=False) is not None for one in (found[0], found[0].strip())):
                return found[0]
        return None

    def _line(self, text: str, tx: Callable[[bytes], None], session: int) -> None:
        if session != self._session:
            return
        if self.table.wire.echo:
            tx(text.encode("latin-1") + self._reply_end)
        line = self._unframed(text if self.table.wire.by_frame else text.strip(" \r\n"))
        if line is None:
            return
        if self._utf8:
            line = line.encode("latin-1").decode("utf-8", "replace")
        try:
            found = self._carried_out(line)
        except Refused:
            found = self._refusal()
        if found is None:
            return
        answer, after_s = found
        said = answer
        if self.table.wire.headers is not None and line.endswith("?"):
            answer = lambda: f"{line[:-1]} {said if isinstance(said, str) else said()}"  # noqa: E731
        sent = partial(self._send, answer, tx, session, self._count_of_lines(line))
        if after_s > 0:
            self._free = self.world.now() + after_s
            self.world.call_in(after_s, sent)
        else:
            sent()

    def _send(self, answer: str | Callable[[], str], tx: Callable[[bytes], None], session: int, lines: int = 1) -> None:
        if session == self._session:
            every = (answer if isinstance(answer, str) else answer()).split(" ", lines - 1)
            for one in (*every, *["-"] * (lines - len(every))):
                # of UTF-8 its bytes, over which a checksum is made
                line = one.encode().decode("latin-1") if self._utf8 else one
                said = self._framed(line).encode("latin-1") + self._reply_end
                if self.table.wire.protocol == "stream":  # whoever begins to listen now hears that it has begun
                    tx(said[:1])
                    said = said[1:]
                tx(said)

    def _unframed(self, text: str) -> str | None:
        """The line in its frame; None if it is for another instrument, or damaged."""
        if self._frames is None and not self._own_frames:
            return text
        if (known := self._of_its_frame(text)) is not None:
            return known
        for frame in (*([self._frames[0]] if self._frames is not None else []), *self._own_frames.values()):
            found = frame.read(text)
            if found is not None and not found[1]:
                return found[0]
        return None if self._frames is not None else text

    def _framed(self, line: str) -> str:
        return line if self._frames is None else self._frames[1].write(line)

    def _carried_out(self, line: str) -> tuple[str | Callable[[], str], float] | None:
        """The answer to a line, and when it comes. Raises `Refused`."""
        if line == self.table.errors.ask and (self.queue or self._status(line) is None):
            return self._told_error(), 0.0
        said = line.removeprefix(":") if self.table.scpi else line
        whole = self._status(line) or self._whole.get(said.casefold())
        for form, place, what in self._open if whole is None else (whole,):
            fields = form.read(said, strict=False)
            if fields is None:
                continue
            holes: dict[str, float | str] = {
                name: form.fields[name].read(text, signed=what is not None and what.signed)
                if name in ("value", "count", "mark")
                else text
                for name, text in fields.items()
            }
            if isinstance(what, Tell):
                self.does(place, what, holes)
                return (self._acknowledged(what, holes), what.wait_s) if what.answer else None
            if what is None:
                return None
            if (takes_s := self.takes_s(place)) > 0:
                return partial(self._later, place, what, holes), takes_s
            told = self.answers(place, what, holes)
            if told.after_s > 0:
                return partial(self._later, place, what, holes), told.after_s
            return self._printed(what, self._with_others(place, what, told), holes), 0.0
        raise Refused

    def _status(self, line: str) -> _Line | None:
        """The question that a line is, of several that read one status: whether it has settled, once it is on."""
        several = {one.place: one for one in self._lines if isinstance(one.what, Ask) and one.what.ask == line}
        on = self.quantity is not None and self.quantity.on
        first = ("source.settled", "source.output") if on else ("source.output", "source.settled")
        return next((several[place] for place in first if place in several), None)

    def _count_of_lines(self, line: str) -> int:
        """Lines of the answer to a question."""
        known = self._whole.get(line.casefold())
        return known.what.lines if known is not None and isinstance(known.what, Ask) else 1

    def _acknowledged(self, tell: Tell, holes: Mapping[str, float | str]) -> str:
        """The acknowledgement of a command: it may repeat what was set."""
        form = self._form(tell.answer[0])
        said: dict[str, float | str] = {"unit": self._unit(), "text": "done", **holes}
        return form.write({name: said.get(name, 0.0 if field.number else "0") for name, field in form.fields.items()})

    def _with_others(self, place: str, ask: Ask, said: Said) -> Said:
        """An answer with the fields that other questions of the file read in it."""
        others = [(p, one) for _, p, one in self._lines if isinstance(one, Ask) and one.ask == ask.ask and p != place]
        if not others or (ask.field == "value" and all(one.field == "value" for _, one in others)):
            return said
        fields: dict[str, Any] = dict(said.fields)
        for at, one in ((place, ask), *others):
            told = said if at == place else self.answers(at, one, {})
            words = {meaning: word for word, meaning in reversed({**self.table.words, **one.words}.items())}
            fields[one.field] = words.get(told.meaning) or (told.value if not isnan(told.value) else "0")
        return said._replace(fields=fields)

    def _later(self, place: str, ask: Ask, holes: Mapping[str, float | str]) -> str:
        return self._printed(ask, self.answers(place, ask, holes), holes)

    def _refusal(self) -> tuple[str, float] | None:
        errors = self.table.errors
        self.queue.append("unknown")
        if errors.replies:
            form = self._form(errors.replies[0])
            return form.write({name: self._code() if name == "code" else "refused" for name in form.fields}), 0.0
        return None

    def _code(self) -> str:
        errors = self.table.errors
        return next(iter(errors.codes), str(1 << int(next(iter(errors.bits)))) if errors.bits else "-113")

    def _told_error(self) -> str:
        errors, form = self.table.errors, self._error
        code = self._code() if self.queue else errors.none
        self.queue = self.queue[1:] if errors.queue and not errors.bits else []
        words = errors.codes.get(code, "refused") if code != errors.none else "No error"
        said = {"code": code, "text": f'"{words}"' if '"' not in form.text else words}
        return form.write({name: said.get(name, "0") for name in form.fields})

    def _of(self, ask: Ask, text: str) -> Form:
        key = id(ask), text
        if key not in self._forms:
            self._forms[key] = Form(text, frozenset(ask.words or self.table.words)).filled(self._parameters)
        return self._forms[key]

    def _printed(self, ask: Ask, said: Said, holes: Mapping[str, float | str]) -> str:
        """An answer in the first form for which everything is known."""
        words = {meaning: word for word, meaning in reversed({**self.table.words, **ask.words}.items())}
        told = said.meaning == "overload" and "overload" in words
        forms = [self._of(ask, text) for text in ask.forms]
        if told:  # the form without a number, if there is one
            forms.sort(key=lambda form: "value" in form.fields)
        for form in forms:
            fields = {name: self._field(ask, field, said, words, holes) for name, field in form.fields.items()}
            if all(one is not None for one in fields.values()):
                answer = form.write({name: one for name, one in fields.items() if one is not None})
                return str(self._hooks["say"](ask.ask or "", answer)) if "say" in self._hooks else answer
        raise Refused

    def _field(
        self, ask: Ask, field: Field, said: Said, words: Mapping[str, str], holes: Mapping[str, float | str]
    ) -> float | str | None:
        name = field.name
        if name in said.fields:
            found: Any = said.fields[name]
            if isinstance(found, list):
                return ",".join(field.write(one) if field.kind else f"{one:+.9E}" for one in found)
            return self._number(ask, field, found) if isinstance(found, float) and name not in ("mark",) else found
        if name in holes:
            return holes[name]
        if name == ask.decimals:
            return str(places_of(ask)[0])
        if name == "unit":
            return self._unit()
        if name == "value":
            if ask.asks_bit:
                return ask.with_bit(said.meaning)
            if isnan(said.value) or (said.meaning in words and said.meaning in ("on", "off", "vent", "overload")):
                return words.get(said.meaning)
            return self._number(ask, field, said.value)
        if field.number:
            return 0.0
        if said.meaning in words:
            return words[said.meaning]
        if words or said.meaning in ("on", "off"):
            return words.get("stable") or {"on": "1", "off": "0"}.get(said.meaning)
        return "0"

    def _number(self, ask: Ask, field: Field, value: float) -> float | str:
        number = ask.shown(value) * 10.0 ** places_of(ask)[1] if abs(value) < OVERLOAD / 2 else value
        if not field.kind and field.decimals < 0 and not field.width:
            return (
                f"{number:+.9E}"
                if self.table.reader is not None and not self.table.reader.resolution
                else f"{number:.9g}"
            )
        if field.width and len(field.write(number)) > field.width:  # it does not fit, and no reading may look like it
            return "*" * field.width
        return number

    def _unit(self) -> str:
        table = self.table
        unit = next(part.unit for part in (table.reader, table.source) if part is not None and part.unit)
        own = next((word for word, meaning in table.units.items() if meaning == unit), None)
        return own or _PRINTED.get(unit or "", (unit or "").replace("_per_", "/"))
