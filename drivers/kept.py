"""Whether settings are as they were set: the question of `rig.drivers.roles.SelfChecking`, in any language."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

Question = TypeVar("Question")
Wanted = TypeVar("Wanted")
Answer = TypeVar("Answer")


def not_kept(
    wanted: Mapping[Question, Wanted], ask: Callable[[Question], Answer], agree: Callable[[Answer, Wanted], bool]
) -> Iterator[tuple[Question, Wanted, Answer]]:
    """Settings with another answer than the wanted one, also when asked again.

    Args:
        wanted: wanted answer, by question.
        ask: asks the instrument; it may raise a `DriverError`.
        agree: whether an answer is the wanted one.

    Yields:
        The question, the wanted answer and the last answer.
    """
    for question, value in wanted.items():
        answers = (ask(question) for _ in range(2))  # lazily: the second question is asked only if the first disagrees
        if not any(agree(answer := one, value) for one in answers):
            yield question, value, answer
