"""Dates and times of day as people and instruments write them: their parts, and the order of day, month and year."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache

DAY_S = 86400.0
PIVOT = 69
"""Years of two digits from 69 on are of the 20th century, others of the 21st, as POSIX reads them (strptime, %y)."""
ORDERS = {"dmy": (2, 1, 0), "mdy": (2, 0, 1), "ymd": (0, 1, 2)}
"""Places of year, month and day among the three numbers of a date."""
SAID = {"dmy": "day first", "mdy": "month first", "ymd": "year first"}
_LONGEST = 60
_LIKELY = re.compile(r"\d:\d\d|\d[-/.]\d{1,2}[-/.]\d\d|\d{8}T\d{4}|[A-Za-z]{3}.*\d|\d.*[A-Za-z]{3}")
"""Signs of a date or time, so that other texts are told quickly."""
_CLOCK = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,:](?P<part>\d{1,9}))?)?"
    r"(?: ?(?P<half>[AaPp]\.?[Mm]\.?))?"
)
_ZONE = r"(?: ?(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}))?"
_AT = rf"(?:(?:[T,:_/-]| at)? *{_CLOCK}{_ZONE})?"
_DAY = r"(?:[A-Za-z]{2,9}[.,]* +)?"
_MONTH = r"(?P<month>[A-Za-z\u00c0-\u00ff]{3,9})\.?"
_FORMS = tuple(
    re.compile(form)
    for form in (
        _CLOCK,
        rf"(?P<a>\d{{4}})(?P<sign>[-/.])(?P<b>\d{{1,2}})(?P=sign)(?P<c>\d{{1,2}}){_AT}",
        rf"(?P<a>\d{{4}})(?P<b>\d{{2}})(?P<c>\d{{2}})T(?P<hour>\d{{2}}):?(?P<minute>\d{{2}}):?(?P<second>\d{{2}})"
        rf"(?:\.(?P<part>\d{{1,9}}))?(?P<half>){_ZONE}",
        rf"(?P<a>\d{{1,2}})(?P<sign>[-/.])(?P<b>\d{{1,2}})(?P=sign)(?P<c>\d{{4}}|\d{{2}}){_AT}",
        rf"{_DAY}(?P<day>\d{{1,2}})\.?[- /]*{_MONTH}[- /,]*(?P<year>\d{{4}}|\d{{2}}){_AT}",
        rf"{_DAY}{_MONTH} +(?P<day>\d{{1,2}}),? +(?P<year>\d{{4}}){_AT}",
        rf"{_DAY}{_MONTH} +(?P<day>\d{{1,2}}) +{_CLOCK} +(?:[A-Z]{{3,4}} +)?(?P<year>\d{{4}})",  # ctime
    )
)
_MONTHS = {
    word: number
    for number, words in enumerate(
        (
            "jan gen ene", "feb fev f\u00e9v", "mar m\u00e4r mrz", "apr avr abr", "may mai mag", "jun jui_n giu",
            "jul jui_l lug", "aug aou ao\u00fb ago", "sep set", "oct okt ott out", "nov", "dec dez d\u00e9c dic",
        ),
        start=1,
    )
    for word in words.replace("_", "").split()
}  # fmt: skip


@dataclass(frozen=True)
class Stamp:
    """A date, a time of day, or both.

    Attributes:
        numbers: three numbers of a date; () without one. In the order year, month, day if `ordered`.
        ordered: whether the text shows which number is which.
        short: whether the year has two digits.
        sign: between the numbers; "" for others.
        second: of the day; None without a time of day.
        zone: seconds east of Greenwich; None if none is written.
    """

    numbers: tuple[int, ...]
    ordered: bool
    short: bool
    sign: str
    second: float | None
    zone: float | None = None

    def date(self, order: str) -> tuple[int, int, int]:
        """Year, month and day, of dates whose numbers come in an order."""
        year, month, day = self.numbers if self.ordered else (self.numbers[i] for i in ORDERS[order])
        return _year(year) if self.short else year, month, day

    def seconds(self, order: str) -> float:
        """Seconds since 1970, without a zone as in Greenwich. Raises `ValueError` if there is no such date."""
        return datetime(*self.date(order), tzinfo=UTC).timestamp() + (self.second or 0.0) - (self.zone or 0.0)

    def fits(self, order: str) -> bool:
        """Whether there is such a date."""
        try:
            self.seconds(order)
        except ValueError:
            return False
        return self.ordered or self.short or order != "ymd"


def stamp_of(cell: str) -> Stamp | None:
    """The parts of a text; None if it is no date and no time of day."""
    if not 4 <= len(cell) < _LONGEST or _LIKELY.search(cell) is None:
        return None
    return _parsed(" ".join(cell.split()))


@lru_cache(maxsize=1 << 16)
def _parsed(text: str) -> Stamp | None:
    for form in _FORMS:
        if (found := form.fullmatch(text)) is not None:
            return _stamp(found.groupdict())
    return None


def _stamp(parts: dict[str, str | None]) -> Stamp | None:
    second, zone = _second(parts), parts.get("zone")
    if parts.get("hour") and second is None:
        return None
    east = None
    if zone:
        sign = -1.0 if zone[0] == "-" else 1.0
        east = sign * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60) if zone[0] in "+-" else 0.0
    if month := parts.get("month"):
        number = _MONTHS.get(month[:4].lower()) or _MONTHS.get(month[:3].lower())
        year = str(parts["year"])
        if number is None:
            return None
        return _real(Stamp((int(year), number, int(str(parts["day"]))), True, len(year) == 2, "", second, east))
    if not parts.get("a"):
        return Stamp((), True, False, "", second)
    a, b, c = (str(parts[one]) for one in "abc")
    short = len(a) <= 2 and len(c) == 2
    return _real(Stamp((int(a), int(b), int(c)), len(a) == 4, short, parts.get("sign") or "", second, east))


def _real(stamp: Stamp) -> Stamp | None:
    """A stamp, if it is a date in some order."""
    return stamp if any(stamp.fits(order) for order in ORDERS) else None


def _second(parts: dict[str, str | None]) -> float | None:
    """Seconds of the day; None for none, or for one that does not exist."""
    if not parts.get("hour"):
        return None
    hour, minute = int(str(parts["hour"])), int(str(parts["minute"]))
    second = float(f"{parts.get('second') or 0}.{parts.get('part') or 0}")
    if half := parts.get("half"):
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if half.lower().startswith("p") else 0)
    value = hour * 3600.0 + minute * 60.0 + second
    return value if value <= DAY_S and minute < 60 and second < 61 else None


def _year(two: int) -> int:
    return two + (1900 if two >= PIVOT else 2000)


def orders_of(stamps: Sequence[Stamp]) -> list[str]:
    """The orders in which all dates exist. With dots between the numbers, the day is first if that is possible."""
    loose = [stamp for stamp in stamps if stamp.numbers and not stamp.ordered]
    found = [order for order in ORDERS if all(stamp.fits(order) for stamp in loose)]
    return ["dmy"] if "dmy" in found and all(stamp.sign == "." for stamp in loose) else found


def of_one_day(stamps: Sequence[Stamp]) -> bool:
    """Whether all dates are the same."""
    return len({stamp.numbers for stamp in stamps}) == 1


def form_of(stamps: Sequence[Stamp]) -> str:
    """How dates are read, in words; "" where the text leaves no doubt: years of four digits first, times of day."""
    loose = [stamp for stamp in stamps if stamp.numbers and not stamp.ordered]
    orders, said = orders_of(loose) if loose else ["dmy"], []
    if len(orders) > 1:
        said.append(f"day and month cannot be told apart: {' or '.join(SAID[one] for one in orders)}")
    elif loose and not orders:
        said.append("days and months in different orders, so that not all are dates")
    elif loose:
        said.append(SAID[orders[0]])
    short = [stamp for stamp in stamps if stamp.short]
    if short and len(orders) == 1:
        years = sorted({stamp.date(orders[0])[0] for stamp in short})
        said.append(f"years of two digits ({' to '.join(dict.fromkeys((str(years[0]), str(years[-1]))))})")
    return ", ".join(said)
