"""Units as instruments and DBC files spell them."""

from __future__ import annotations

from collections.abc import Mapping

ALIKE: Mapping[str, frozenset[str]] = {
    "degC": frozenset({"C", "CEL", "DEGC", "DEG C"}),
    "degF": frozenset({"F", "FAR", "DEGF", "DEG F"}),
    "K": frozenset({"K", "KEL"}),
    "V": frozenset({"V", "VDC", "V DC", "VAC", "V AC", "VOLT", "VOLTS"}),
    "A": frozenset({"A", "ADC", "A DC", "AAC", "A AC", "AMP", "AMPS"}),
    "ohm": frozenset({"OHM", "OHMS", "OHM4W"}),
    "Hz": frozenset({"HZ"}),
    "s": frozenset({"S", "SEC", "SECS"}),
    "pct": frozenset({"%"}),
}
"""Ways in which a unit is spelled."""


_SIGNS = str.maketrans({"\u00b0": "deg", "\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm"})
"""The degree sign, both characters that look like mu, and both that look like omega."""


def same_unit(printed: str, declared: str) -> bool:
    """Whether a unit that an instrument prints is the declared one, as at the end of column names."""
    plain = "_per_".join(part.strip() for part in printed.translate(_SIGNS).split("/"))
    return plain == declared or plain.upper() in ALIKE.get(declared, ())
