"""The questions as a form asks them: all at once, with what was given, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rig.errors import RigError
from rig.files.toml_text import toml_text
from rig.new.answers import Answers
from rig.new.questions import Question, due


@dataclass(frozen=True)
class Asked:
    """A question with its answer.

    Attributes:
        question: the question.
        value: its answer as a text, given or assumed.
        assumed: the answer by the earlier ones, as a text.
        choices: names that can be chosen, each with what it is.
        wrong: why the given answer is none; "" if it is one.
    """

    question: Question
    value: str
    assumed: str
    choices: Mapping[str, str]
    wrong: str = ""


def asked(given: Mapping[str, Any], assumed: Mapping[str, str]) -> tuple[list[Asked], Answers]:
    """The questions up to the first wrong answer, and the checked answers.

    Args:
        given: answers by key.
        assumed: what a form proposed; an answer that is still the same follows the earlier ones anew.

    Example:
        >>> shown, answers = asked({"quantity": "pressure", "levels": "0 1 one"}, {})
        >>> [one.question.key for one in shown if one.wrong], answers["sets_in"]
        (['levels'], 'bar')
    """
    answers: Answers = {}
    found: list[Asked] = []
    for question in due(answers):
        default = question.default(answers)
        said = given.get(question.key)
        if said is None or said == assumed.get(question.key):
            said = default
        try:
            answers[question.key] = question.check(said, answers)
            wrong = ""
        except (ValueError, RigError) as error:
            wrong = str(error)
        found.append(Asked(question, as_typed(said), as_typed(default), question.choices(answers), wrong))
        if wrong:
            break
    return found, answers


def as_typed(value: Any) -> str:
    """A value as a person types it."""
    if isinstance(value, list):
        return " ".join(f"{one:.12g}" for one in value)
    if isinstance(value, dict):
        return toml_text({"x": [value]}).strip().removeprefix("x = [").removesuffix("]")
    return f"{value:.12g}" if isinstance(value, float) else str(value)
