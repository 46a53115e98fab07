"""Questions and commands of a Druck PACE whose line is made as it goes: module, setting and value."""

from __future__ import annotations

from functools import lru_cache

from rig.contracts.declared.exchanges import Ask, Tell
from rig.drivers.declared.text import TextTalk
from rig.drivers.errors import BadReply
from rig.drivers.numbers import decimal

_COMMAND = Tell(tell="{text}")


@lru_cache(maxsize=256)
def _question(text: str) -> Ask:
    return Ask(ask=text, answer=("{text}",))


class PaceScpi:
    """Questions and commands on its lines.

    Args:
        talk: the lines of its file.
    """

    def __init__(self, talk: TextTalk) -> None:
        self._talk, self.line = talk, talk.line

    def ask(self, question: str) -> str:
        """The value of an answer. Raises `BadReply` for a second that makes no sense, `NoReply`."""
        return self._talk.ask(_question(question)).fields["text"]

    def send(self, command: str) -> None:
        """Send a command and check that it was not refused."""
        self._talk.tell(_COMMAND, {"text": command})

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
