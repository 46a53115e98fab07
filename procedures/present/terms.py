"""Terms of a model as people read them; a formula to copy stays as it is written."""

from __future__ import annotations

from collections.abc import Iterator


def in_words(text: str) -> str:
    """A text in which every `I(...)` is a product in words; anything else is unchanged.

    Names stand before what is in brackets, and arithmetic that is no product stands in brackets.

    Example:
        >>> in_words("coefficient I((oven_degC - 25) * force_kN)"), in_words("1 + x + I(x / (x + 1) - 2)")
        ('coefficient force_kN times (oven_degC - 25)', '1 + x + (x / (x + 1) - 2)')
    """
    begin = text.find("I(")
    while begin > 0 and (text[begin - 1].isalnum() or text[begin - 1] == "_"):
        begin = text.find("I(", begin + 1)
    end = _closing(text, begin + 1) if begin >= 0 else -1
    if end < 0:
        return text
    return f"{text[:begin]}{_product(text[begin + 2 : end])}{in_words(text[end + 1 :])}"


def _closing(text: str, opening: int) -> int:
    """Index of the bracket that closes one; -1 if none does."""
    return next((at for at, deep in _depths(text[opening:], opening) if not deep), -1)


def _depths(text: str, begin: int = 0) -> Iterator[tuple[int, int]]:
    """Index of each character, and the number of brackets that are open after it."""
    deep = 0
    for at, one in enumerate(text, begin):
        deep += (one == "(") - (one == ")")
        yield at, deep


def _product(arithmetic: str) -> str:
    outside = [at for at, deep in _depths(arithmetic) if not deep]
    if any(arithmetic[at] in "+-/<>=!" and arithmetic[:at].strip() for at in outside):
        return f"({arithmetic})"
    power = {at + n for at in outside if arithmetic[at : at + 2] == "**" for n in (0, 1)}
    cuts = [at for at in outside if arithmetic[at] == "*" and at not in power]
    ends = zip([-1, *cuts], [*cuts, len(arithmetic)], strict=True)
    factors = [arithmetic[a + 1 : b].strip() for a, b in ends]
    return " times ".join(sorted(factors, key=lambda one: not one.isidentifier()))
