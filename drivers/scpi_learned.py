"""The way a meter prints its readings: the unit after a number, and the form of a number, learned from the first ones.

A character that is lost or doubled on the way can leave a number that looks right: `+1.25E+02` without its first digit
is 25. Most meters print all numbers with exponent in one form, and plain decimals with one number of decimals or of
digits. Once a few readings have shown it, a reading of another form is refused. A digit that is lost before the point
does not change the number of decimals: see `rig.run_file.state.lost_digits`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from rig.contracts.declared.units import ALIKE

_NR3 = re.compile(r"([+-]?)([0-9]*\.?[0-9]*[Ee][+-]?[0-9]+)")
_DECIMAL = re.compile(r"([+-]?)([0-9]*)(\.?)([0-9]*)")
_FEWEST = 5
"""Readings of one form, at least, before another one is refused."""
_NO_FORM, _OR = "any", " or "
_OTHERS = re.compile(r"[pnumkMG]?(V|A|OHMS?|HZ|PA|BAR|PSI|N|G|M)( ?[AD]C)?", re.IGNORECASE)
_WITH_UNIT = re.compile(r"([+-]?[0-9.]+(?:[Ee][+-]?[0-9]+)?) *([A-Za-z%][A-Za-z0-9%/ ]*)")


def unit_after(text: str) -> tuple[str, str]:
    """A printed number without the unit after it, and that unit, "" if there is none: "50.0 C" is "50.0" and "C"."""
    found = _WITH_UNIT.fullmatch(text)
    return (found[1], found[2].rstrip()) if found else (text, "")


def is_unit(printed: str) -> bool:
    """Whether a text is known as a unit of anything."""
    return bool(_OTHERS.fullmatch(printed)) or any(printed.upper() in names for names in ALIKE.values())


class PrintedForm:
    """The form of the readings of one meter: `+#.####E+##`, `#.##` (two decimals) or `#. 5` (five digits).

    A form that one reading does not have is dropped. A meter without a form that all readings have has none. So does
    one that prints another form twice in succession. Numbers with an exponent are hardly ever printed in two forms:
    where the first of them differ, nobody knows which are whole, so all are asked again and learning begins anew.
    """

    def __init__(self) -> None:
        self._seen = 0
        self._forms: frozenset[str] | None = None  # None before the first reading
        self._sign = ""
        self._refused = False

    @property
    def learned(self) -> dict[str, str | int]:
        """Number of readings seen, up to the fewest needed, their forms, and the sign of positive ones."""
        forms = _OR.join(sorted(self._forms or ())) or _NO_FORM
        return {"readings": self._seen, "form": forms, "sign": self._sign} if self._seen else {}

    def recall(self, learned: Mapping[str, str | int]) -> None:
        """Take an earlier `learned`."""
        self._seen = int(learned.get("readings", 0))
        self._sign = str(learned.get("sign", ""))
        forms = str(learned.get("form", _NO_FORM))
        if self._seen:
            self._forms = frozenset() if forms == _NO_FORM else frozenset(forms.split(_OR))

    def strange(self, numbers: Sequence[str]) -> str:
        """The first of some readings, as printed, of another form than all before; "" if there is none."""
        for number in numbers:
            sign, forms = _forms(number)
            kept = forms if self._forms is None else self._forms & forms
            if kept and (sign in ("-", self._sign) or not self._sign):
                self._forms = kept
                self._sign = self._sign or (sign if sign == "+" else "")
            elif self._forms and not self._refused and (self._seen >= _FEWEST or _exponents(self._forms, forms)):
                self._refused = True
                if self._seen < _FEWEST:
                    self._seen, self._forms, self._sign = 0, None, ""
                return number
            else:
                self._forms = frozenset()
            self._seen = min(self._seen + 1, _FEWEST)
        self._refused = False
        return ""


def _exponents(*several: frozenset[str]) -> bool:
    """Whether all of these forms have an exponent."""
    return all("E" in form.upper() for forms in several for form in forms)


def _forms(number: str) -> tuple[str, frozenset[str]]:
    """Sign of a number, and the forms that it may have without it."""
    if found := _NR3.fullmatch(number):
        return found[1], frozenset({re.sub("[0-9]", "#", found[2].replace("E-", "E+").replace("e-", "e+"))})
    if found := _DECIMAL.fullmatch(number):
        sign, whole, point, rest = found.groups()
        begin = f"{'#' if whole else ''}{point}"
        return sign, frozenset({begin + "#" * len(rest), f"{begin} {len(whole + rest)}"})
    return "", frozenset()
