"""Forms: a line of text with named fields in braces, for whoever reads it and whoever writes it.

`S {state} {value:10.2} {unit}` is `S S     100.00 g`. After the name stands, as in Python, what is always so: `+` (a
sign), `0` (zeros before), width, decimals (`.2`, or `,2` after a comma), and the kind: `e` with exponent, `e2` with one
of a sign and two digits, `d` whole, `x` hexadecimal. `{}` is any text. One space stands for any number of spaces; `{{`
and `}}` are braces.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

_HOLE = re.compile(r"\{\{|\}\}|\{([A-Za-z_][A-Za-z0-9_]*)?(?::([^{}]*))?\}|[{}]")
_SPEC = re.compile(r"(<)?(\+)?(0)?([1-9][0-9]?)?(?:([.,])([0-9]{1,2}))?([dx]|e2?)?")
_ANY_NUMBER = r"[+-]? *(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]{1,3})?"
_WHOLE_NUMBER = re.compile(_ANY_NUMBER, re.ASCII)
TEXTS = {
    "unit": r"[A-Za-z%*\u00b0\u00b5\u03a9\u03bc\u2126][A-Za-z0-9%/*^._ \u03a9\u2126-]*?",
    "text": r".*?",
    "line": r".*?",
    "checksum": r".*?",
    "maker": r".+?",
    "model": r".+?",
    "serial": r".*?",
    "firmware": r".*?",
}
"""Fields that are texts, which may contain spaces."""
_NUMBERS = ("value", "values", "mark", "count", "code")


@dataclass(frozen=True)
class Field:
    """One field of a form.

    Attributes:
        name: "" for any text.
        left: whether it is at the left of its width.
        sign: whether a plus is printed.
        zeros: whether zeros fill its width.
        width: number of characters, 0 if it varies.
        decimals: of a number, -1 if they vary.
        kind: "e", "e2", "d", "x", or "" for a number without exponent, or for a text.
        comma: whether a comma is printed before its decimals.
    """

    name: str
    left: bool = False
    sign: bool = False
    zeros: bool = False
    width: int = 0
    decimals: int = -1
    kind: str = ""
    comma: bool = False

    @property
    def text(self) -> str:
        """As it stands in a form."""
        spec = f"{'<' * self.left}{'+' * self.sign}{'0' * self.zeros}{self.width or ''}"
        spec += f"{'.,'[self.comma]}{self.decimals}" * (self.decimals >= 0) + self.kind
        return f"{{{self.name}{':' * bool(spec)}{spec}}}"

    @property
    def number(self) -> bool:
        """Whether it can only be a number."""
        return self.name in _NUMBERS or bool(self.kind) or self.decimals >= 0

    def pattern(self, words: frozenset[str]) -> str:
        """Pattern of its text, without the spaces of its width."""
        found = self._pattern(words)
        return found.replace(r"\.", ",") if self.comma else found

    def _pattern(self, words: frozenset[str]) -> str:
        if not self.name:
            return ".*?"
        if self.name in TEXTS:
            return TEXTS[self.name]
        if words and not self.number:
            known = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
            numbers = any(re.fullmatch(_ANY_NUMBER, word) for word in words)
            return f"{known}|{_ANY_NUMBER}" if numbers or not self.name.startswith("state") else known
        sign, digits = r"[+-]" if self.sign else "[+-]?", "{1,9}" if self.decimals < 0 else f"{{{self.decimals}}}"
        match self.kind:
            case "x":
                return "[0-9A-Fa-f]+"
            case "d":
                return f"{sign}[0-9]+"
            case "e" | "e2":
                power = "[+-]?[0-9]{1,3}" if self.kind == "e" else "[+-][0-9]{2}"
                one = rf"{sign}[0-9]\.[0-9]{digits}[Ee]{power}"
                return f"{one}(?:,{one})*" if self.name == "values" else one
        if self.decimals == 0:
            return rf"{sign} *[0-9]+\.?"
        if self.decimals > 0:
            return rf"{sign} *[0-9]*\.[0-9]{digits}"
        if self.name == "values":
            return f"{_ANY_NUMBER}(?: *, *{_ANY_NUMBER})*"
        return _ANY_NUMBER.replace("[+-]?", sign, 1) if self.number else r"[^\s,;]+"

    def read(self, text: str, *, signed: bool = False) -> float:
        """The finite number in a text; a hexadecimal one may be `signed`, a two's complement. Raises `ValueError`."""
        text = text.replace(" ", "")
        if self.comma:
            text = text.replace(",", ".")
        if self.kind == "x":
            number, bits = int(text, 16), 4 * (self.width or len(text))
            return float(number - (1 << bits) if signed and number >> (bits - 1) & 1 else number)
        if not _WHOLE_NUMBER.fullmatch(text):
            raise ValueError(f"{text!r} is not a number")
        value = float(text)
        if not math.isfinite(value):
            raise ValueError(f"{text!r} is not a finite number")
        return value

    @cached_property
    def _spec(self) -> str:
        """How Python formats its numbers."""
        digits = 9 if self.decimals < 0 and self.kind[:1] == "e" else self.decimals
        decimals = f".{digits}" if digits >= 0 and self.kind not in ("d", "x") else ""
        kind = {"": "f", "e": "E", "d": "d", "x": "X"}[self.kind[:1]]
        return f"{'<' * self.left}{'+' * self.sign}{'0' * self.zeros}{self.width or ''}{decimals}{kind}"

    def write(self, value: float | str) -> str:
        """A value as it is printed."""
        if isinstance(value, str):
            return value.ljust(self.width) if self.left or not self.number else value.rjust(self.width)
        if self.kind in ("d", "x"):
            value = round(value)
            if self.kind == "x" and value < 0:  # its two's complement
                value += 1 << 4 * self.width
                if value < 0:
                    raise ValueError(f"{value} does not fit into {self.width} hexadecimal digits")
        elif self.decimals >= 0:
            value = round(value, self.decimals) + 0.0 if self.kind[:1] != "e" else value
        if self.kind or self.decimals >= 0:
            printed = format(value, self._spec)
            return printed.replace(".", ",") if self.comma else printed
        text = f"{value:{'+' if self.sign else ''}.9g}"
        return text.zfill(self.width) if self.zeros else text.rjust(self.width)


class Form:
    """A line with named fields.

    Args:
        text: see the module.
        words: what its fields that are neither numbers nor names may be; () for any word.

    Raises:
        ValueError: a brace alone, two fields of one name, or a field that makes no sense.
    """

    def __init__(self, text: str, words: frozenset[str] = frozenset()) -> None:
        self.text, self._words = text, words
        self.parts: list[str | Field] = []
        at = 0
        for hole in _HOLE.finditer(text):
            self._literal(text[at : hole.start()])
            at = hole.end()
            if hole[0] in ("{{", "}}"):
                self._literal(hole[0][0])
            elif len(hole[0]) == 1:
                raise ValueError(f"{text!r} has a brace alone; write it twice if it is meant")
            else:
                self.parts.append(_field(hole[1] or "", hole[2] or "", text))
        self._literal(text[at:])
        self.fields = {part.name: part for part in self.parts if isinstance(part, Field) and part.name}
        if len(self.fields) != sum(isinstance(part, Field) and bool(part.name) for part in self.parts):
            raise ValueError(f"{text!r} has two fields of one name")

    def _literal(self, text: str) -> None:
        if text and self.parts and isinstance(self.parts[-1], str):
            self.parts[-1] += text
        elif text:
            self.parts.append(text)

    @cached_property
    def _strict(self) -> re.Pattern[str]:
        return re.compile(self.pattern(strict=True), re.ASCII)

    @cached_property
    def _inner(self) -> dict[str, re.Pattern[str]]:
        """Patterns of fields with a width, without the spaces of it."""
        wide = {name: field.pattern(self._words) for name, field in self.fields.items() if field.width}
        return {name: re.compile(pattern, re.ASCII) for name, pattern in wide.items()}

    @cached_property
    def _free(self) -> re.Pattern[str]:
        return re.compile(self.pattern(strict=False), re.ASCII | re.IGNORECASE)

    def pattern(self, *, strict: bool = True) -> str:
        """Regular expression of the line; see `read`."""
        found = []
        for n, part in enumerate(self.parts):
            if isinstance(part, str):
                found.append(" +".join(map(re.escape, re.split(" +", part))))
                continue
            inner = part.pattern(self._words) if strict or part.comma or not part.number else _ANY_NUMBER
            if part.kind == "x":
                inner = part.pattern(self._words)
            if part.width and strict:
                # a line's ends have no spaces: there the width of a field may be less
                least = 1 if n in (0, len(self.parts) - 1) else part.width
                inner = f"(?=[ ]*(?:{inner})[ ]*)[ -~]{{{least},{part.width}}}"
            # an instrument may right-align its numbers
            elif part.name and part.name not in TEXTS:
                inner = f" *(?:{inner})"
            found.append(f"(?P<{part.name}>{inner})" if part.name else f"(?:{inner})")
        return "".join(found)

    def read(self, line: str, *, strict: bool = True) -> dict[str, str] | None:
        """Its fields in a line, without spaces around them; None if the line has another form.

        Args:
            line: the line, without its end.
            strict: whether numbers have the form that is declared; otherwise any form, and capitals do not matter.
        """
        found = (self._strict if strict else self._free).fullmatch(line)
        if found is None:
            return None
        fields = {name: text.strip() for name, text in found.groupdict().items()}
        if strict and not all(pattern.fullmatch(fields[name]) for name, pattern in self._inner.items()):
            return None
        return fields

    def otherwise(self, line: str) -> dict[str, str] | None:
        """Its fields in a line by another split of texts that have no comma or semicolon between them; None if there is
        only one.

        Example:
            >>> Form("{model} {firmware}").otherwise("T1 XL 1.2")
            {'model': 'T1 XL', 'firmware': '1.2'}
        """
        texts = [part if isinstance(part, str) else part.name in TEXTS or not part.name for part in self.parts]
        parted = [
            before is True and (after is True or not set(str(after)) & set(",;")) for before, after in pairwise(texts)
        ]
        if not any(parted):
            return None
        # literal characters are escaped in it, so these are the texts that take as little as they can
        found = re.fullmatch(self.pattern().replace(".+?", ".+").replace(".*?", ".*"), line, re.ASCII)
        fields = {name: text.strip() for name, text in found.groupdict().items()} if found is not None else None
        return fields if fields != self.read(line) else None

    def write(self, values: Mapping[str, float | str]) -> str:
        """The line with these fields; any text is left out, or a stroke where a space would end the line."""
        return "".join(
            [
                part if isinstance(part, str) else part.write(values[part.name]) if part.name else self._left_out(part)
                for part in self.parts
            ]
        )

    def _left_out(self, part: Field) -> str:
        """Any text as it is written."""
        ends = (self.parts[:2], self.parts[-2:][::-1])
        bare = [end[0] for end in ends if len(end) == 2 and isinstance(end[1], str) and " " in (end[1][0], end[1][-1])]
        return "-" * (part in bare)

    def filled(self, known: Mapping[str, str | float]) -> Form:
        """The same with known fields as texts."""
        if not self.fields.keys() & known.keys():
            return self
        text = "".join(
            part.replace("{", "{{").replace("}", "}}")
            if isinstance(part, str)
            else str(part.write(known[part.name])).replace("{", "{{").replace("}", "}}")
            if part.name in known
            else part.text
            for part in self.parts
        )
        return Form(text, self._words)

    @property
    def literal(self) -> str:
        """The longest text that is always in it."""
        return max((part.strip() for part in self.parts if isinstance(part, str)), key=len, default="")


def step_of(printed: str) -> float:
    """The step of the last digit of a printed number; 1 if it has no decimal point."""
    printed = printed.replace(" ", "").replace(",", ".").upper()
    mantissa, _, power = printed.partition("E") if "." in printed else ("", "", "")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def _field(name: str, spec: str, text: str) -> Field:
    found = _SPEC.fullmatch(spec)
    if found is None:
        raise ValueError(
            f"{{{name}:{spec}}} in {text!r}: after the colon: + 0 width .decimals or ,decimals and e, e2, d or x"
        )
    left, sign, zeros, width, point, decimals, kind = found.groups()
    digits = -1 if decimals is None else int(decimals)
    return Field(name, bool(left), bool(sign), bool(zeros), int(width or 0), digits, kind or "", point == ",")
