"""SCPI instruments that the bench file describes: its options as the table of a declared instrument.

Driver and lines are those of declared instruments (`rig.drivers.declared`). Its own are regular expressions, and the
form of numbers with a unit beside them, which no form of a file says.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.roles import Mark
from rig.contracts.declared.units import same_unit
from rig.contracts.declared.wire import Errors, Identity, Wire
from rig.drivers import roles
from rig.drivers.declared.base import Remembering
from rig.drivers.declared.talk import NOTHING, Answer, Holes, Talk
from rig.drivers.declared.text import TextTalk
from rig.drivers.driver import Medium
from rig.drivers.errors import WrongInstrument
from rig.drivers.numbers import decimal
from rig.drivers.scpi import PREPARED
from rig.drivers.scpi_learned import is_unit, unit_after
from rig.drivers.scpi_options import ScpiOptions
from rig.drivers.wires import Wires
from rig.drivers.wires.serial_options import LineSettings

_EVENTS = {"2": "query error", "3": "device error", "4": "execution error", "5": "command error"}
"""Errors by their bit in the standard event register (IEEE 488.2, 11.5.1)."""
_IDENTITY = ("{maker},{model},{serial},{firmware}", "{maker},{model},{serial}", "{maker},{model}")
_ANY = ("{text}",)


def line(text: str, **holes: str) -> str:
    """A line of a bench file as a form: braces are its own, but for its placeholders, which get these forms."""
    found = text.replace("{", "{{").replace("}", "}}")
    for name, form in holes.items():
        found = found.replace(f"{{{{{name}}}}}", f"{{{name}{form}}}")
    return found


def ask(text: str, **more: Any) -> Ask:
    """A question with any answer."""
    return Ask(ask=line(text), answer=_ANY, **more)


def tell(text: str, **holes: str) -> Tell:
    """A command."""
    return Tell(tell=line(text, **holes))


class DescribedTalk(TextTalk):
    """Lines of text, with numbers as the bench file describes them."""

    options: ScpiOptions
    number_form: re.Pattern[str]
    numbers: frozenset[str] = frozenset()
    """Questions whose answer has the instrument's number."""

    def read(self, ask: Ask, raw: str, holes: Holes = NOTHING) -> Answer:
        """The meaning of an answer. Raises `BadReply`."""
        if ask.ask not in self.numbers:
            return super().read(ask, raw, holes)
        printed, value = self.printed_in(ask.said, raw)
        return Answer({}, value, "", printed)

    def printed_in(self, question: str, answer: str) -> tuple[str, float]:
        """The number in an answer as printed, and its value. Raises `BadReply`, also for another unit after it."""
        options = self.options
        found, digits, form = self.number_form.fullmatch(answer), options.digits, options.number
        number, unit = unit_after(found[1]) if found is not None else ("", "")
        if found is not None and digits and not re.fullmatch(digits, number, re.ASCII):
            raise self.line.bad_reply(question, answer, f"a number of the form {digits!r}")
        if unit and not same_unit(unit, options.unit) and (is_unit(unit) or "*" not in form):
            what = f"a number in {options.unit}, as in the bench file; was its unit changed at the panel?"
            raise self.line.bad_reply(question, answer, what)
        try:
            if found is not None:
                return number, decimal(number)
        except ValueError:
            pass
        raise self.line.bad_reply(question, answer, f"a number as in {form!r}")


class Described(Remembering):
    """A declared instrument whose table is in the bench file."""

    wire: ClassVar[Medium] = "serial"
    numbers: ClassVar[tuple[str, ...]] = ()
    """Options with questions whose answer has the instrument's number."""
    _talk: DescribedTalk

    def _opened(self, address: str, wires: Wires) -> Talk:
        options = self._options
        self.table = table_of(options, self._roles())  # type: ignore[misc]  # of one instance
        settings = LineSettings(options.baud, options.frame, options.flow_at(address))
        talk = DescribedTalk(self.table, self.name, address, settings, {}, wires, self._clock)
        talk.options, talk.number_form = options, options.number_pattern
        talk.numbers = frozenset(line(text) for key in self.numbers if (text := getattr(options, key)))
        return talk

    def _roles(self) -> Mapping[str, Any]:
        """Its reader or source."""
        raise NotImplementedError(f"{type(self).__name__} has no role")

    def identify(self) -> roles.Identity:
        """Ask for the identity. Nothing but *IDN? is sent."""
        pattern = self._options.identity
        if not pattern:
            return super().identify()
        self._listen()
        assert self.table.identity is not None
        answer = self._talk.ask(self.table.identity).printed
        if not re.fullmatch(pattern, answer):
            raise WrongInstrument(f"{self._where} should be a {pattern}; it answers {answer!r} to '*IDN?'")
        parts = [part.strip() for part in answer.split(",", 3)]
        return roles.Identity(*(parts + [""] * 4)[:4])

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the questions of `check` and `healthy`, without settings that `start`
        changes.
        """
        ours = (getattr(self._options, "start", None) or "").upper()
        kept = [one for one in self.table.check if (one.ask or "").partition("?")[0].strip(":").upper() not in ours]
        return (*self._unlike(kept), *self._unlike(self.table.healthy))

    def _lost(self) -> bool:
        return super()._lost() if self.table.mark is not None else bool(self._unlike(self.table.check))


def table_of(options: ScpiOptions, role: Mapping[str, Any]) -> Instrument:
    """The table of an instrument with these options and a role."""
    events = options.error.upper().endswith("*ESR?")
    checks, healthy = (
        tuple(
            Check(ask=line(q), answer=_ANY, is_=one if isinstance(one, str) else float(one)) for q, one in every.items()
        )
        for every in (options.check, options.healthy)
    )
    mark = Mark(tell=(tell("*PSC 1"), tell(f"*ESE {PREPARED}")), check=Check(ask="*ESE?", is_=float(PREPARED)))
    return Instrument.model_construct(
        maker=options.maker,
        model=(options.model,),
        wire=Wire.model_construct(
            send_end=options.send_end.decode(), timeout_s=options.timeout_s, pace_s=options.pace_s
        ),
        identity=Identity(ask="*IDN?", answer=_ANY if options.identity else _IDENTITY),
        errors=Errors(
            ask=line(options.error),
            answer=("{code}",) if events else ("{code},{text}", "{code}"),
            bits=_EVENTS if events else {},
        ),
        prepare=tuple(tell(text) for text in options.prepare),
        check=checks,
        healthy=healthy,
        mark=mark if options.mark else None,
        **role,
    )
