"""Units of tables in the notation of the Digital SI (D-SI): `kN/in^2` as SI units, with a factor.

Units with a symbol in the 9th SI brochure, with prefixes, and others that are defined by them (psi, standard gravity).
The latter appear in a certificate together with their value in SI units.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from math import pi

from rig.errors import UsageError
from rig.procedures.column_names import spelled, split_unit

_PREFIXES = {
    "Y": "yotta", "Z": "zetta", "E": "exa", "P": "peta", "T": "tera", "G": "giga", "M": "mega", "k": "kilo",
    "h": "hecto", "da": "deca", "d": "deci", "c": "centi", "m": "milli", "u": "micro", "µ": "micro", "μ": "micro",
    "n": "nano", "p": "pico", "f": "femto", "a": "atto",
}  # fmt: skip
_SI = {
    "V": "volt", "A": "ampere", "ohm": "ohm", "Ohm": "ohm", "Ω": "ohm", "Pa": "pascal", "N": "newton", "J": "joule",
    "W": "watt", "Hz": "hertz", "m": "metre", "s": "second", "K": "kelvin", "mol": "mole", "cd": "candela",
    "rad": "radian", "F": "farad", "C": "coulomb", "H": "henry", "T": "tesla", "S": "siemens", "g": "gram",
    "lm": "lumen", "lx": "lux", "l": "litre", "L": "litre", "Wb": "weber",
}  # fmt: skip
_WHOLE = {
    "degC": "degreecelsius", "°C": "degreecelsius", "deg": "degree", "°": "degree", "arcmin": "arcminute",
    "arcsec": "arcsecond", "min": "minute", "h": "hour", "d": "day", "kg": "kilogram", "%": "percent",
}  # fmt: skip
"""Units without prefixes of ours."""
_PSI = Decimal("0.45359237") * Decimal("9.80665") / Decimal("0.0254") ** 2
_DEFINED = {
    "psi": ("\\pascal", _PSI),
    "psia": ("\\pascal", _PSI),
    "psig": ("\\pascal", _PSI),
    "inHg": ("\\pascal", Decimal("3386.389")),
    "torr": ("\\pascal", Decimal(101325) / Decimal(760)),
    "mmHg": ("\\pascal", Decimal("133.322387415")),
    "atm": ("\\pascal", Decimal(101325)),
    "bar": ("\\pascal", Decimal(100000)),
    "mbar": ("\\pascal", Decimal(100)),
    "gn": ("\\metre\\second\\tothe{-2}", Decimal("9.80665")),
    "lbf": ("\\newton", Decimal("4.4482216152605")),
    "kgf": ("\\newton", Decimal("9.80665")),
    "in": ("\\metre", Decimal("0.0254")),
    "ppm": ("\\one", Decimal("1e-6")),
    "mdeg": ("\\degree", Decimal("1e-3")),
    "udeg": ("\\degree", Decimal("1e-6")),
}
"""Units that are not of the SI brochure: their unit there, and the factor."""
_TOKEN = re.compile(r"\s*(?:([*/·.()])|(1(?![\d.])|%|°C?|[A-Za-zµμΩ]+)(?:(?:\^|\*\*)?\(?(-?\d+)\)?)?)\s*")


@dataclass(frozen=True)
class SIUnit:
    """A unit as D-SI writes it.

    Attributes:
        text: in the notation of D-SI, such as `\\milli\\volt\\pascal\\tothe{-1}`.
        factor: value in this unit over value in the given one.
        original: the given unit, if it is not of the SI brochure; otherwise "".
        definition: of the original in SI units, as a sentence.
    """

    text: str
    factor: Decimal = Decimal(1)
    original: str = ""
    definition: str = ""


def si_unit(unit: str) -> SIUnit:
    """A unit of a table in D-SI. Raises `UsageError` if it is not known there."""
    text, factor, defined = "", Decimal(1), dict[str, None]()
    factors = _factors(unit)
    for name, power in factors:
        if name in _DEFINED:
            base, per = _DEFINED[name]
            factor *= per**power
            text += "".join(_raised(one, int(own or 1) * power) for one, own in _PARTS.findall(base) if one != "\\one")
            defined[f"1 {name} = {+per.normalize():.10g} {plain_unit(base) or '(ratio)'}"] = None
        elif name in ("degC", "°C") and factors != [(name, 1)]:
            text += _raised("\\kelvin", power)  # of a difference
        else:
            text += _raised(_single(name, unit), power)
    if not defined:
        return SIUnit(text or "\\one")
    return SIUnit(text or "\\one", factor, unit, "; ".join(defined))


def ratio(of: str, to: str) -> float | None:
    """Number of units `to` in a difference of one `of`, by their base units: of kg*m^2/A^2/s^3 in an ohm it is 1.

    None if they are of different dimensions, or one is not known.
    """
    found, wanted = _in_base(of), _in_base(to)
    if found is None or wanted is None or found[1] != wanted[1]:
        return None
    return found[0] / wanted[0]


def _in_base(unit: str) -> tuple[float, Mapping[str, int]] | None:
    """A unit as a number of products of base units, with their powers; None if it is not known."""
    size, powers = 1.0, Counter[str]()
    try:
        for name, power in _factors(unit):
            base, per = _DEFINED.get(name, ("", Decimal(1)))
            symbol = plain_unit(base) if base else name
            for length in (0, 1, 2):
                prefix, rest = symbol[:length], symbol[length:]
                if rest in _BASE and (not length or (prefix in _TENS and rest not in _WHOLE)):
                    own, dimensions = _BASE[rest]
                    size *= (own * 10.0 ** _TENS.get(prefix, 0)) ** power * float(per) ** power
                    for one, times in dimensions.items():
                        powers[one] += times * power
                    break
            else:
                if symbol:
                    return None
                size *= float(per) ** power
    except UsageError:
        return None
    return size, {one: power for one, power in powers.items() if power}


_TENS = {
    "Y": 24, "Z": 21, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1, "": 0, "d": -1, "c": -2,
    "m": -3, "u": -6, "µ": -6, "μ": -6, "n": -9, "p": -12, "f": -15, "a": -18,
}  # fmt: skip
_BASE: Mapping[str, tuple[float, Mapping[str, int]]] = {
    **{one: (1.0, {one: 1}) for one in ("m", "s", "A", "K", "mol", "cd", "rad")},
    "kg": (1.0, {"kg": 1}),
    "g": (1e-3, {"kg": 1}),
    **dict.fromkeys(("degC", "°C"), (1.0, {"K": 1})),
    **dict.fromkeys(("deg", "°"), (pi / 180.0, {"rad": 1})),
    "arcmin": (pi / 10800.0, {"rad": 1}),
    "arcsec": (pi / 648000.0, {"rad": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "d": (86400.0, {"s": 1}),
    **dict.fromkeys(("%", "pct"), (1e-2, {})),
    **dict.fromkeys(("l", "L"), (1e-3, {"m": 3})),
    "Hz": (1.0, {"s": -1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "C": (1.0, {"A": 1, "s": 1}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    **dict.fromkeys(("ohm", "Ohm", "Ω"), (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2})),
    "S": (1.0, {"kg": -1, "m": -2, "s": 3, "A": 2}),
    "F": (1.0, {"kg": -1, "m": -2, "s": 4, "A": 2}),
    "H": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "T": (1.0, {"kg": 1, "s": -2, "A": -1}),
    "Wb": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -1}),
}
"""Units in base units: number, and powers (SI brochure, tables 2, 4 and 8)."""


def per_term(unit: str) -> str:
    """Unit of a coefficient, with the unit of its term: `V per unit of force_kN^2` is `V/kN^2`.

    All divisors stand in one bracket: `Hz*min/(kg*degC)`.

    The units of a term are the ends of its names. Of arithmetic, `I(...)`, products of them are known, also less a
    number: of `Hz per unit of I((oven_degC - 25) * force_kN)` it is `Hz/(degC*kN)`. A unit of a term with functions is
    unchanged.
    """
    own, between, term = unit.partition(" per unit of ")
    term = _SHIFTED.sub(r"\1", whole[1] if (whole := _WHOLE_TERM.fullmatch(term)) else term)
    found = [_FACTOR_OF_TERM.fullmatch(one.strip()) for one in re.split(r"[:*](?!\*)(?<!\*\*)", term)]
    factors = [(split_unit(one[1]), int(one[2] or 1)) for one in found if one is not None]
    if not between or len(factors) < len(found) or not all(stem and _is_plain(unit) for (stem, unit), _ in factors):
        return unit
    above, below = [own] if own else [], []
    for (_, of_term), power in factors:
        first, *others = (_raised_to(part, power) for part in of_term.split("_per_"))
        below.append(first)
        above += others
    divisor = below[0] if len(below) == 1 else f"({'*'.join(below)})"
    return f"{'*'.join(above) or '1'}/{divisor}"


def _is_plain(unit: str) -> bool:
    return all(_LETTERS.fullmatch(part) for part in unit.split("_per_"))


def _raised_to(part: str, power: int) -> str:
    """A power of a part of a unit of a column: `m^6` of the square of `m3`."""
    one = _LETTERS.fullmatch(part)
    assert one is not None
    whole = int(one[2] or 1) * power
    return one[1] + (f"^{whole}" if whole != 1 else "")


_FACTOR_OF_TERM = re.compile(r"([A-Za-z]\w*_[A-Za-z]\w*?)(?:(?:\^|\*\*)(\d+))?")
_WHOLE_TERM = re.compile(r"I\((.*)\)")
_SHIFTED = re.compile(r"\(([A-Za-z]\w*) [-+] [\d.]+(?:e[-+]?\d+)?\)")
"""A variable less a number, which has the unit of the variable."""
_LETTERS = re.compile(r"([A-Za-z]+)(\d*)")


_PARTS = re.compile(r"(\\[a-zA-Z]+)(?:\\tothe\{(-?\d+)\})?")


def _factors(unit: str) -> list[tuple[str, int]]:
    """Name and power of each factor; what follows a slash, alone or in brackets, is inverse. Raises `UsageError`."""
    found: list[tuple[str, int]] = []
    text, at, sign, inside, before = spelled(unit.strip()) or "1", 0, 1, 0, "*"
    while at < len(text):
        token = _TOKEN.match(text, at)
        follows = token[1] or "unit" if token else ""
        if token is None or follows not in _MAY_FOLLOW[before] or (follows == ")" and not inside):
            raise UsageError(f"unit {unit!r} cannot be written in SI units; write it like kN/m^2")
        at, (mark, name, power), before = token.end(), token.groups(), follows
        if mark == "/":
            sign = -1
        elif mark in ("(", ")"):
            inside, sign = (sign, sign) if mark == "(" else (0, 1)
        elif name is not None:
            if name != "1":
                found.append((name, sign * int(power or 1)))
            sign = inside or 1
    if before not in ("unit", ")") or inside:
        raise UsageError(f"unit {unit!r} cannot be written in SI units; write it like kN/m^2")
    return found


_SIGNS = ("*", "/", "·", ".")
_MAY_FOLLOW = {"unit": (*_SIGNS, ")"), ")": _SIGNS, "(": ("unit",), **dict.fromkeys(_SIGNS, ("unit", "("))}
"""What may follow a part of a unit."""


def _single(name: str, unit: str) -> str:
    """D-SI of one unit with its prefix. Raises `UsageError`."""
    if name in _WHOLE:
        return f"\\{_WHOLE[name]}"
    if name in _SI:
        return f"\\{_SI[name]}"
    for length in (2, 1):
        prefix, rest = name[:length], name[length:]
        if prefix in _PREFIXES and rest in _SI:
            return f"\\{_PREFIXES[prefix]}\\{_SI[rest]}"
    raise UsageError(f"unit {unit!r} cannot be written in SI units: {name!r} is not known; write it like kN/m^2")


def _raised(text: str, power: int) -> str:
    return text if power == 1 else f"{text}\\tothe{{{power}}}"


def plain_unit(text: str) -> str:
    """A unit of D-SI as tables have it: `\\kilo\\newton\\metre\\tothe{-2}` is `kN/m^2`. An unknown one is unchanged."""
    if text.startswith("|"):
        return text[1:]
    factors: list[tuple[str, int]] = []
    prefix, sign = "", 1
    for name, power in re.findall(r"\\([a-zA-Z]+)(?:\{(-?\d+)\})?", text):
        if name == "per":
            sign = -1
        elif name == "tothe" and factors:
            factors[-1] = (factors[-1][0], factors[-1][1] * int(power or 1))
        elif name in _SYMBOLS_OF_PREFIXES:
            prefix = _SYMBOLS_OF_PREFIXES[name]
        elif name in _SYMBOLS:
            factors.append((prefix + _SYMBOLS[name], sign))
            prefix, sign = "", 1
        elif name != "one":
            return text
    above = [symbol if power == 1 else f"{symbol}^{power}" for symbol, power in factors if power > 0]
    below = [symbol if power == -1 else f"{symbol}^{-power}" for symbol, power in factors if power < 0]
    return ("*".join(above) or ("1" if below else "")) + "".join(f"/{one}" for one in below)


_SYMBOLS_OF_PREFIXES = {name: symbol for symbol, name in _PREFIXES.items() if symbol not in "µμ"}
_SYMBOLS = {name: symbol for symbol, name in reversed([*_SI.items(), *_WHOLE.items()])} | {"degreeCelsius": "degC"}
