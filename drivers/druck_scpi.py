"""SCPI of Druck PACE instruments: every answer repeats its header, and the error queue is short.

The header distinguishes a late answer from the expected one. There is one question per line, and the error queue (five
entries) is emptied after every command. Source: SCPI manual K0472, sections 2 and 3.
"""

from __future__ import annotations

from functools import lru_cache

from rig.drivers.errors import BadReply, DriverError, InstrumentError
from rig.drivers.numbers import decimal
from rig.drivers.scpi import raise_errors
from rig.drivers.wires import SerialLine

_MOST_ERRORS = 5  # length of its queue (K0472)
SYNC = (":SYST:VERS?", ":SYST:VERS ")
"""A question that is only used for synchronisation, and the header of its answer."""


class PaceScpi:
    """Questions and commands on an open line.

    Args:
        line: the instrument's line.
    """

    def __init__(self, line: SerialLine) -> None:
        self.line = line

    def flag(self, question: str) -> bool:
        """Ask for a value that is 0 or 1."""
        answer = self.ask(question)
        if answer not in ("0", "1"):
            raise self.line.bad_reply(question, answer, "0 or 1")
        return answer == "1"

    def number(self, question: str) -> float:
        """Ask for a number."""
        return self.as_number(question, self.ask(question))

    def as_number(self, question: str, answer: str) -> float:
        """The number in an answer. Raises `BadReply`."""
        try:
            return decimal(answer)
        except ValueError:
            raise self.line.bad_reply(question, answer, "a number") from None

    def check(self, question: str, wanted: float, allowed: float) -> None:
        """Read a setting back. Raises `BadReply` if the deviation is too large."""
        answer = self.number(question)
        if not abs(answer - wanted) <= allowed:
            raise BadReply(f"{self.line.where}: {question} should answer {wanted:g} and answers {answer:g}")

    def ask(self, question: str, *, repeat: bool = True) -> str:
        """The value of an answer, without its header; asked again if the answer is garbled or belongs to another
        question.

        Raises:
            BadReply: the second answer is wrong too.
            NoReply: no answer in time.
        """
        asked = question.removesuffix("?")
        for _ in range(2 if repeat else 1):
            try:
                answer = self.line.query(question, repeat=repeat)
            except BadReply as garbled:
                error = garbled
                continue
            header, _, value = answer.partition(" ")
            if header[:1] not in (":", "*"):
                return answer  # the echo of headers can be switched off in newer instruments
            if _same_header(asked, header):
                return value.strip()
            error = self.line.bad_reply(question, answer, f"{asked} and a value")
        raise error

    def send(self, command: str) -> None:
        """Send a command and check that it was not refused."""
        self.line.write(command)
        raise_errors(self.line, lambda: self.ask(":SYST:ERR?", repeat=False), _MOST_ERRORS)

    def forget_errors(self) -> None:
        """Empty the error queue of errors from earlier sessions."""
        try:
            raise_errors(self.line, lambda: self.ask(":SYST:ERR?", repeat=False), _MOST_ERRORS)
        except InstrumentError:
            return
        except DriverError:
            self.line.drain()


@lru_cache(maxsize=256)
def _same_header(asked: str, echoed: str) -> bool:
    """Whether an echoed header is the expected one: optional nodes may be spelt out, numbers left out.

    A number must be the expected one, or 1 if none was sent: answers of another module are refused.
    """
    asked_nodes, told_nodes = (_nodes(text) for text in (asked, echoed))
    for (name, number), (told, told_number) in zip(asked_nodes, told_nodes, strict=False):
        if name != told or told_number not in ("", number or "1"):
            return False
    rest = ":".join(name for name, _ in told_nodes[len(asked_nodes) :])
    return len(told_nodes) >= len(asked_nodes) and rest in ("", "LEV:IMM:AMPL", "STAT")


def _nodes(header: str) -> list[tuple[str, str]]:
    """The nodes of a header, each with its number, "" if it has none."""
    nodes = header.upper().removeprefix(":").rstrip(":").split(":")
    return [(node.rstrip("0123456789"), node[len(node.rstrip("0123456789")) :]) for node in nodes]
