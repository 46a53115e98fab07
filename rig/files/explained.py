"""Defects of a file's values as lines a person can act on: pydantic's findings in our words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError

from rig.procedures.present.meant import meant, nearest

_PLAIN = {
    "bool_type": "should be true or false, without quotes",
    "int_type": "should be a whole number, without quotes or decimal point",
    "float_type": "should be a number, without quotes",
    "string_type": "should be a text in quotes",
    "list_type": "should be a list in square brackets, such as [0, 10]",
    "tuple_type": "should be a list in square brackets, such as [0, 10]",
    "dict_type": "should be a table, { NAME = VALUE }",
    "finite_number": "should be a finite number",
    "date_from_datetime_parsing": "should be a date, such as 2028-05-31",
    "date_parsing": "should be a date, such as 2028-05-31",
    "date_type": "should be a date, such as 2028-05-31",
}


def explain(error: ValidationError, where: str, model: type[BaseModel], *, shown: bool = True) -> str:
    """One line per defect, each with file and place.

    Possible secrets are not `shown`, except numbers and short plain words.
    """
    return "\n".join(f"{where}: {_line(item if shown else _veiled(item), model)}" for item in _each(error.errors()))


_OF_PATTERNS = (
    (
        r"[a-z][a-z0-9]*(-[a-z0-9]+)*",
        "should be a word of small letters and digits, or several with hyphens: pads-locked",
    ),
    (
        r"[A-Za-z][A-Za-z0-9_]*_[A-Za-z][A-Za-z0-9_]*",
        "should be a name and its unit, with an underscore between: force_kN",
    ),
    (
        r"[A-Za-z][A-Za-z0-9]*(_per_[A-Za-z][A-Za-z0-9]*)?",
        "should be a unit of letters and digits, such as V, with the word per for a slash: L_per_min",
    ),
    (r"[A-Z]{2}", "should be two capital letters by ISO 3166-1, such as GB"),
    (
        r"[^/\\\x00-\x1f]*\{next(:0\d+d)?\}[^/\\\x00-\x1f]*",
        "should have one {next}, such as LC-{year}-{next:04d}, and no slash",
    ),
    (r"[123](0[1-9]|1[0-9]|20)", "should be a slot and a channel of the scanner: 101 to 120, 201 to 220 or 301 to 320"),
    (r"-?\d+(\.\d+)?([eE][+-]?\d+)?", 'should be a number as text, with the digits that it has: "0.0210"'),
    (r"0\.\d+", 'should be a probability as text: "0.95"'),
    (r"(none|event-[1-8]|key-[1-4])", "should be none, event-1 to event-8, or key-1 to key-4"),
)
"""Patterns of texts, and what to write. A test finds a pattern of our models that is not here."""


def of_pattern(pattern: str) -> str:
    """What to write for a text that has to match a pattern, as the end of a sentence."""
    plain = pattern.removesuffix("|^$").removeprefix("^").removesuffix("$")
    return dict(_OF_PATTERNS).get(plain, f"should match the pattern {pattern!r}")


_BRANCH = re.compile(r"(constrained-)?(float|int|str|bool|date)|(tuple|list|dict|literal|function-[a-z]+)\[.*")
"""What pydantic adds to the place of a value that may be of several types."""


def _each(items: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Findings; for a value that may be of several types, those of the type that it has, or one about all types."""
    groups: dict[tuple[int | str, ...], list[tuple[int, Mapping[str, Any]]]] = {}
    for item in items:
        place = item["loc"]
        cut = next((n for n, part in enumerate(place) if _BRANCH.fullmatch(str(part))), len(place))
        groups.setdefault(place[:cut], []).append((cut, item))
    for place, ones in groups.items():
        of_its_type = [(cut, item) for cut, item in ones if not item["type"].endswith("_type")]
        if len(ones) == 1:
            yield ones[0][1]
        elif of_its_type:
            yield from ({**item, "loc": (*place, *item["loc"][cut + 1 :])} for cut, item in of_its_type)
        else:
            words = [_PLAIN.get(item["type"], item["msg"]).removeprefix("should be ") for _, item in ones]
            yield {**ones[0][1], "loc": place, "type": "alternatives", "msg": f"should be {', or '.join(words)}"}


_SHORT_WORD = re.compile(r"[a-z-]{1,20}")


def _veiled(item: Mapping[str, Any]) -> Mapping[str, Any]:
    """A finding of pydantic without its value, unless the value cannot be a secret."""

    def harmless(value: Any) -> bool:
        return isinstance(value, bool | int | float) or bool(_SHORT_WORD.fullmatch(str(value)))

    context = item.get("ctx", {})
    if "tag" in context and not harmless(context["tag"]):
        context = {**context, "tag": "..."}
    return {**item, "ctx": context, "input": item.get("input") if harmless(item.get("input")) else {}}


def _line(item: Mapping[str, Any], model: type[BaseModel]) -> str:
    place = ".".join(str(part) for part in item["loc"])
    got = item.get("input")
    match item["type"]:
        case "extra_forbidden":
            return f"{place} is unknown here{_near_field(model, item['loc'])}"
        case "missing":
            return f"{place} is missing"
        case "union_tag_not_found":
            return f"{place}.{item['ctx']['discriminator'].strip(chr(39))} is missing"
        case "union_tag_invalid":
            key, known = item["ctx"]["discriminator"].strip("'"), _quoted(item["ctx"]["expected_tags"])
            return f"{place}.{key} = {item['ctx']['tag']!r} is unknown; {_near(item['ctx']['tag'], known)}"
        case "literal_error" if isinstance(got, str):
            return f"{place}: {got!r} is unknown; {_near(got, _quoted(item['ctx']['expected']))}"
        case _:
            said = item["msg"].removeprefix("Value error, ").removeprefix("Input ")
            said = re.sub(r"^(List|Dictionary|Tuple) should have at least 1 .*", "is empty", said)
            said = re.sub(r"^(List|Dictionary|Tuple) (should have .*) items? after validation", r"\2 entries", said)
            words = of_pattern(item["ctx"]["pattern"]) if item["type"] == "string_pattern_mismatch" else said
            words = _PLAIN.get(item["type"], words)
            shown = "" if isinstance(got, Mapping) or not place else f" (it is {got!r})"
            return f"{place}: {words}{shown}".removeprefix(": ")


def _quoted(text: str) -> list[str]:
    return re.findall(r"'([^']*)'", text)


def _near(given: str, known: Iterable[str]) -> str:
    known = list(known)
    near = nearest(given, known)
    return f"did you mean {near!r}?" if near else f"known: {', '.join(repr(k) for k in known)}"


def _near_field(model: type[BaseModel], place: tuple[int | str, ...]) -> str:
    """The known name nearest to an unknown one, at a place inside nested tables."""
    inner: list[type[BaseModel]] = [model]
    parts = iter(place[:-1])
    for part in parts:
        fields = [m.model_fields[str(part)] for m in inner if str(part) in m.model_fields]
        if fields:
            inner = [m for field in fields for m in _models(field.annotation)]
            if any(get_origin(field.annotation) is dict for field in fields):
                next(parts, None)  # the user's name of the table
        else:  # the number of a table, or its discriminator
            inner = [m for m in inner if _is_of_kind(m, part)] or inner
    names = [name for m in inner for name in m.model_fields]
    if not names:
        return ""
    return meant(str(place[-1]), names) or f" (known: {', '.join(dict.fromkeys(names))})"


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """All possible models of the table at a place."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models(argument)


def _is_of_kind(model: type[BaseModel], tag: int | str) -> bool:
    return any(
        get_origin(field.annotation) is Literal and tag in get_args(field.annotation)
        for field in model.model_fields.values()
    )
