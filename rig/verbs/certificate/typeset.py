"""Numbers of a certificate on paper: digits in groups of three, a real minus sign, powers of ten.

The texts of `rig.verbs.certificate.document` are plain (`-0.000123`, `1.23e-05`), as XML and JSON have them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_GROUP = "\u202f"
"""A narrow space at which no line is broken; ISO 80000-1 separates digits by spaces."""
_PLAIN = re.compile(r"([+-]?)(\d+)(?:\.(\d+))?(?:[eE]([+-]?\d+))?")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER = re.compile(r"(?:\^|\*\*)(?:\((-?\d+)\)|(-?\d+))")
"""A whole power; the bracket belongs to it only where it has both ends: `(x^2)` keeps its own."""
_LONGEST = 4
"""Maximum number of digits on one side of the point that are not grouped."""


def typeset(text: str) -> str:
    """A number as it is printed; any other text is returned unchanged.

    Examples: `-0.000123` is `−0.000 123` with narrow spaces, `1.2e-05` is `1.2 × 10⁻⁵`.
    """
    found = _PLAIN.fullmatch(text)
    if found is None:
        return {"inf": "∞", "-inf": "−∞"}.get(text, text)
    sign, whole, fraction, power = found.groups()
    shown = ("−" if sign == "-" else sign) + _grouped_whole(whole)
    if fraction is not None:
        shown += f".{_grouped(fraction)}"
    if power is not None:
        shown += f" × 10{str(int(power)).translate(_RAISED)}"
    return shown


def raised(text: str) -> str:
    """A text with raised whole powers, real minus signs and degrees Celsius: `kN/m^2` is `kN/m²`."""
    text = re.sub(r"\bdegC\b", "°C", text)
    text = _POWER.sub(lambda power: (power[1] or power[2]).translate(_RAISED), text)
    return re.sub(r"(?<![\w)^-])-(?=\d)", "−", text)


def plain(text: str) -> str:
    """The plain text of a printed number: the inverse of `typeset`."""
    lowered = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    text = text.replace(_GROUP, "").replace("−", "-").replace("\u00a0", " ")
    mantissa, power_of, power = text.partition(" × 10")
    return f"{mantissa}e{power.translate(lowered)}" if power_of else mantissa


def _grouped_whole(digits: str) -> str:
    return _grouped(digits[::-1])[::-1]


def _grouped(digits: str) -> str:
    if len(digits) <= _LONGEST:
        return digits
    return _GROUP.join(digits[at : at + 3] for at in range(0, len(digits), 3))


def padding(texts: Sequence[str]) -> list[str]:
    """Invisible text behind each printed number of a column, so that points stand below each other.

    Args:
        texts: printed numbers, or other texts, set flush right in figures of equal width.
    """
    behind = [_behind(text) for text in texts]
    longest = max((len(one) for one in behind), default=0)
    padded = []
    for one in behind:
        missing = "0" * (longest - len(one))
        padded.append(missing if one or not missing else f".{missing[1:]}")
    return padded


def _behind(text: str) -> str:
    """The point and all behind it."""
    return text[text.index(".") :] if "." in text else ""
