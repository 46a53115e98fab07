"""Talk with a declared instrument: questions with an answer that has a meaning, and commands."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import NamedTuple

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.hooks import Function
from rig.contracts.declared.instrument import Instrument
from rig.drivers.clock import Clock
from rig.drivers.errors import BadReply, InstrumentError
from rig.drivers.scpi import agrees

Holes = Mapping[str, float | str]
"""Values for the braces of a line."""
NOTHING: Holes = {}
_BUSY_S, _BUSY_TRIES = 0.25, 40
"""Pause until a busy instrument is asked again, and how often: ten seconds; chosen."""


class Answer(NamedTuple):
    """An answer.

    Attributes:
        fields: its fields as printed.
        value: its number as quantity; NaN if it has none.
        meaning: meaning of its word, its number or its bit; "" if nothing is said of it.
        printed: its number, or its word, as printed.
    """

    fields: Mapping[str, str]
    value: float
    meaning: str
    printed: str


class Talk(ABC):
    """Common part of all wires.

    Args:
        table: the instrument's file.
        clock: bench time.
        where: the instrument and its address, for messages.
    """

    def __init__(self, table: Instrument, clock: Clock, where: str) -> None:
        self.table, self.clock, self.where = table, clock, where
        self.hooks: Mapping[str, Function] = {}
        self.watches = False  # whether it is looked at what follows the first answer to a question
        self.quiet = not table.prepare  # it may talk by itself until it is prepared
        self.printed: dict[int, tuple[str, float]] = {}
        """Numbers as they were read last, and as quantities, by the identity of their question."""
        self._free = -math.inf  # the time from which the next line, request or message may be sent

    @abstractmethod
    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """Ask once, or twice if no answer comes and `repeat`. Raises `NoReply`, `BadReply`, `InstrumentError`."""

    @abstractmethod
    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Send a command; if `checked`, look whether it was refused. Never repeated. Raises `InstrumentError`."""

    def paced(self) -> None:
        """Keep the distance to what was sent last."""
        pace_s = self.table.wire.pace_s
        if pace_s or self._free > -math.inf:
            self.clock.sleep(self._free - self.clock.now())
            self._free = self.clock.now() + pace_s

    def waits(self, tell: Tell) -> None:
        """Note the time that a command takes."""
        if tell.wait_s:
            self._free = self.clock.now() + tell.wait_s

    @abstractmethod
    def close(self) -> None:
        """Release the wire; idempotent."""

    def value_of(self, ask: Ask, field: str, found: Answer) -> float:
        """The number in another field of an answer, as quantity. Raises `BadReply`."""
        raise self.bad(ask, found.printed, f"no field {field}: a register has none")

    def raise_errors(self) -> None:  # noqa: B027
        """Ask for errors. Raises `InstrumentError`. An instrument that has no question for them says nothing."""

    def forget_errors(self) -> None:  # noqa: B027
        """Forget errors that are nobody's."""

    def assume(self, tells: Sequence[Tell]) -> None:  # noqa: B027
        """Take commands as sent, whose effect was read: messages repeat what was sent last."""

    def renew(self) -> None:  # noqa: B027
        """Begin anew: the instrument may have been off."""

    def sweep(self) -> None:  # noqa: B027
        """A sweep over all channels begins: one message may have readings of several."""

    def drain(self) -> None:  # noqa: B027
        """Listen until it is silent."""

    def clear(self) -> None:
        """Have it give up what it does, if it can be told to; listen until it is silent."""
        self.drain()

    @property
    def remote(self) -> tuple[Tell, ...]:
        """The command for remote control, which locks its panel; () if there is none on this wire."""
        return ()

    def takes_s(self, characters: int) -> float:
        """Maximum bench seconds for this many characters on the wire."""
        return 0.0

    def bad(self, ask: Ask | Tell, answer: object, expected: str) -> BadReply:
        """The error for an answer that makes no sense."""
        return BadReply(f"{self.where} answered {answer!r} to {ask.said!r}; expected {expected}")

    def ask(self, ask: Ask, holes: Holes = NOTHING) -> Answer:
        """Ask without side effect: again if the answer makes no sense, later if it is busy.

        Raises:
            NoReply, BadReply: twice in a row.
            InstrumentError: it reports an error.
        """
        for _ in range(_BUSY_TRIES):
            try:
                found = self.once(ask, holes)
            except BadReply:
                found = self.once(ask, holes)
            if found.meaning != "busy":
                return found
            self.clock.sleep(_BUSY_S)
        raise self.bad(ask, found.printed, "an end of being busy")

    def number(self, ask: Ask, holes: Holes = NOTHING) -> float:
        """The number in an answer. Raises `BadReply` if it has none."""
        found = self.ask(ask, holes)
        if found.value != found.value or found.meaning == "overload":
            raise self.bad(ask, found.printed, "a number")
        return found.value

    def right(self, check: Check) -> str:
        """A sentence if a question has another answer, also when asked again; otherwise ""."""
        for _ in range(2):
            found = self.ask(check)
            if self.agree(found, check.is_):
                return ""
        said = f"{check.said} answers {self.told(check, found)}"
        return f"{check.why} ({said})" if check.why else f"{said}, not {check.is_}"

    @staticmethod
    def told(check: Check, found: Answer) -> str:
        """An answer as it compares with the right one: as printed, or as quantity where it has a scale."""
        return f"{found.value:g}" if found.value == found.value and check.quantity(1.0) != 1.0 else found.printed

    @staticmethod
    def agree(found: Answer, wanted: float | str) -> bool:
        """Whether an answer is a number or a text, or means it."""
        if isinstance(wanted, str):
            return wanted in (found.printed, found.meaning or None)
        if "values" in found.fields:  # of several channels
            return all(agrees(one.strip(), wanted) for one in found.printed.split(","))
        return found.value == wanted or agrees(found.printed, wanted) or agrees(f"{found.value!r}", wanted)

    def meant(self, ask: Ask, printed: str, number: float | None, holes: Holes = NOTHING) -> str:
        """Meaning of a word or number. Raises `InstrumentError` if it means an error."""
        words = {**self.table.words, **ask.words}
        found = words.get(printed)
        if found is None and number is not None:
            found = next((meaning for word, meaning in words.items() if agrees(word, number)), None)
        if found is None:
            return ""
        kind, _, text = found.partition(":")
        if kind == "error":
            said = reduce(lambda line, hole: line.replace(f"{{{hole}}}", f"{holes[hole]}"), holes, ask.said)
            raise InstrumentError(f"{self.where}, asked {said!r},", 0, text.strip() or f"error {printed!r}")
        return kind
