"""The run's own scatter: whether the readings of a point contradict one another, where nobody declared a limit.

Three questions are asked about the readings of one quantity at one point:

1. Does one reading stand apart from all the others of this point? It is compared with their mean and scatter (Student's
   t of a deleted residual). The noise of other points does not matter here.
2. Do they scatter more than at the points before? (F test.) This needs `FEWEST` points. It finds what the first
   question cannot: two readings that differ, or as many readings on one side as on the other.
3. As long as there are fewer points: do they differ by much of their size? They are read again. Noise differs in
   another way then. Readings that differ in the same way, such as one of the previous channel each time, contradict
   one another.

The usual scatter is not the same everywhere. It may grow with the value, but not faster than the value. A tenth of the
points may scatter more than the others. What three of the last five points show is usual too. A slow drift within a
point is no contradiction, and neither is a change of the last digit.

All of this follows from the last `KEPT` accepted observations in the run file. A resumed run decides as if it had never
stopped.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist
from types import MappingProxyType
from typing import NamedTuple

from rig.chances import chance_f, chance_t
from rig.procedures.column_names import unit_of
from rig.run_file.events.points import CONTRADICTORY, Observed

KEPT = 200
"""Accepted observations with which a point is compared."""
FEWEST = 5
"""Points, at least, for a comparison with their scatter."""
LOOK_BACK = 8
"""Accepted observations after which the first points are compared with the others."""
ALARM = 4e-4
"""Probability of a false alarm at a point, for all its quantities and both questions."""
_RECENT = 5
_QUIET, _ALL_BUT_ODD = 0.25, 0.9
_SDS, _DF = 1.5, 0.25
"""Factor by which the usual sd may be too small; degrees of freedom that a point adds to it, as a part of its own.
Chosen by simulation: noise that is constant, grows or falls with the setting, in random or ascending order."""
_DIGITS, _COARSE = 10, 1e-3
"""Significant digits of a reading that has a last digit, at most. Otherwise its step is unknown: at most this part of
it, as that of a meter with three digits. Where the last digit seems to be more than that, earlier readings
are asked."""
_ROUNDED, _ALTERNATING = 1.0 / 12.0, 0.25
"""Variance in squared steps: of a rounded reading, and of one that alternates between two digits."""
_NEAR_ZERO_SDS, _ALIKE = 3.0, 10.0
_MUCH, _SAME = 0.3, 0.1
"""Part of their size by which readings of one point differ much; part of that by which readings taken again may differ
from the first ones, to be the same."""
_SURELY_FEW_SDS, _SURELY_NO_MORE = 3.0, _SDS**2
"""Distances and ratios up to which no probability is computed."""


class Scattered(NamedTuple):
    """Scatter of the readings of one quantity at one point.

    Attributes:
        variance: of one reading, without a slow drift, in squared units of the quantity.
        df: number of readings less one.
        size: magnitude of the middle reading, the smaller one of two.
        step: smallest difference between two readings; 0 if all are equal.
        steps: number of different neighbours in size.
        digit: one step of the last digit of the readings; 0 if they have too many digits to tell.
        point: index of the point; -1 if unknown.
        doubted: whether it was flagged.

    """

    variance: float
    df: int
    size: float
    step: float
    steps: int
    digit: float
    point: int = -1
    doubted: bool = False

    @classmethod
    def of(cls, readings: Sequence[float], point: int = -1, *, doubted: bool = False) -> Scattered:
        """Of at least two readings."""
        ordered = sorted(readings)
        steps = [b - a for a, b in pairwise(ordered) if b > a]
        n, least = len(ordered), min(steps, default=0.0)
        digits = [last_digit(r) for r in set(readings) if r]
        digit = 0.0 if math.inf in digits else min(digits, default=0.0)
        return cls(
            _variance(readings),
            n - 1,
            min(abs(ordered[n // 2]), abs(ordered[(n - 1) // 2])),
            least,
            len(steps),
            digit,
            point,
            doubted,
        )


@dataclass(frozen=True)
class Contradiction:
    """Readings of a quantity that contradict one another.

    Attributes:
        name: its column.
        point: index of the point; -1 if it is the new one.
        words: what contradicts what: a sentence about the point.

    """

    name: str
    point: int
    words: str


class OwnScatter:
    """The scatter of the last accepted observations, by quantity.

    Args:
        judged: columns that are compared; None for all.
        sizes: magnitudes that columns will have in the run, where they are known.

    """

    def __init__(
        self, judged: Collection[str] | None = None, sizes: Mapping[str, float] = MappingProxyType({})
    ) -> None:
        self._judged, self._sizes = judged, sizes
        self._seen: dict[str, deque[Scattered]] = {}
        self._points = 0

    @property
    def doubted(self) -> bool:
        """Whether one of the observations is flagged as contradictory."""
        return any(one.doubted for seen in self._seen.values() for one in seen)

    def _several(self, readings: Mapping[str, Sequence[float]]) -> dict[str, Sequence[float]]:
        judged = self._judged
        return {n: r for n, r in readings.items() if len(r) > 1 and (judged is None or n in judged)}

    def add(self, point: int, readings: Mapping[str, Sequence[float]], *, doubted: bool = False) -> None:
        """Take an accepted observation.

        Args:
            point: index of its point.
            readings: by column.
            doubted: whether it is flagged as contradictory.

        """
        self._points += 1
        for name, values in self._several(readings).items():
            seen = self._seen.setdefault(name, deque(maxlen=KEPT))
            seen.append(Scattered.of(values, point, doubted=doubted))

    def recall(self, point: int, observed: Observed) -> None:
        """Take an accepted observation of the run file; as `add`."""
        self.add(point, observed.every_reading, doubted=CONTRADICTORY in observed.flags)

    def contradiction(
        self,
        readings: Mapping[str, Sequence[float]],
        again: Sequence[Mapping[str, Sequence[float]]] | None = None,
    ) -> Contradiction | None:
        """The first quantity whose readings at a new point contradict one another; None if there is none.

        Args:
            readings: by column.
            again: likewise, earlier readings at this point that were not accepted; None if readings are not taken
                again, so that the third question is not asked.

        """
        several = self._several(readings)
        for name, values in several.items():
            p, before, unit = ALARM / 2.0 / len(several), self._seen.get(name, ()), unit_of(name)
            now = Scattered.of(values)
            words = _apart(values, now, before, p, unit) or _scatters(now, before, p, unit)
            if not words and again is not None and len(before) < FEWEST:
                words = _differ(values, max([self._sizes.get(name, 0.0), *(b.size for b in before)]), again[-1:], name)
            if words:
                return Contradiction(name, -1, f"{name} {words}")
        return None

    def first(self, readings: Mapping[str, Sequence[float]]) -> Iterator[Contradiction]:
        """Contradictions at the first points, which nothing could be compared with, once there are `LOOK_BACK` points.

        Args:
            readings: of the observation that will be added next, by column.

        """
        if self._points != LOOK_BACK - 1:
            return
        several = self._several(readings)
        for name, values in several.items():
            every = [*self._seen.get(name, ()), Scattered.of(values)]
            for one in every[:-1]:
                others = [other for other in every if other is not one]
                words = "" if one.doubted else _scatters(one, others, ALARM / 2.0 / len(several), unit_of(name))
                if words:
                    yield Contradiction(name, one.point, f"{name} {words}")


def _apart(values: Sequence[float], now: Scattered, before: Sequence[Scattered], p: float, unit: str) -> str:
    """Words for one reading that stands apart from all the others; "" if none does, or if there are only two."""
    n = len(values)
    if n < 3 or not now.step:
        return ""
    middle = sorted(values)[n // 2]
    far = max(range(n), key=lambda i: abs(values[i] - middle))
    others = [v for i, v in enumerate(values) if i != far]
    mean = math.fsum(others) / (n - 1)
    about = math.fsum([(v - mean) ** 2 for v in others]) / (n - 2) + _ROUNDED * _digit(now, before) ** 2
    if not about:  # zero, and of unknown resolution
        return ""
    t = abs(values[far] - mean) / math.sqrt(about * n / (n - 1))
    if t <= _SURELY_FEW_SDS or (2.0 * n * chance_t(n - 2, -t) >= p and not _other_sign(values[far], others, before)):
        return ""
    low, high = min(others), max(others)
    rest = f"{low:.6g}" if low == high else f"from {low:.6g} to {high:.6g}"
    return f"reads {values[far]:.6g} {unit} once, and {rest} {unit} the other {n - 1} times"


def _other_sign(value: float, others: Sequence[float], before: Sequence[Scattered]) -> bool:
    """Whether a reading differs from others, all equal, in its sign alone; only where no scatter is known yet.

    Only whole numbers from 10 on, whose last digit is not to be seen: small readings may be noise about zero.
    """
    known = len(before) >= FEWEST or {-value} != set(others)
    return not known and abs(value) >= _ALIKE and last_digit(value) >= 1.0


def _scatters(now: Scattered, before: Sequence[Scattered], p: float, unit: str) -> str:
    """Words for a scatter that is larger than usual; "" if it is not, or if too few points are known."""
    if len(before) < FEWEST or not now.step:
        return ""
    usual, digit = _usual(now, before), _ALTERNATING * _digit(now, before) ** 2
    ratio = (now.variance + digit) / (usual + digit) if usual + digit else math.inf
    if ratio <= _SURELY_NO_MORE or chance_f(now.df, _DF * now.df * len(before), ratio / _SDS**2) >= p:
        return ""
    return f"scatters by {math.sqrt(now.variance):.2g} {unit} (sd), and usually by {math.sqrt(usual):.2g} {unit}"


def _differ(values: Sequence[float], size: float, again: Sequence[Mapping[str, Sequence[float]]], name: str) -> str:
    """Words for readings that differ by much of their size, and in the same way as before; "" if they do not.

    Args:
        values: the readings.
        size: largest magnitude at the points before.
        again: the last readings here before these, by column; [] if these are the first.
        name: the column.
    """
    span = max(values) - min(values)
    if span <= _MUCH * max(size, *map(abs, values)):
        return ""
    for earlier in again:
        before = earlier.get(name, ())
        if len(before) != len(values) or any(abs(a - b) > _SAME * span for a, b in zip(before, values, strict=True)):
            return ""
    return f"reads from {min(values):.6g} to {max(values):.6g} {unit_of(name)}"


def _variance(readings: Sequence[float]) -> float:
    """Variance of one reading; a slow drift through the readings adds little to it.

    It is the smaller one of the variance and of half the mean squared difference of successive readings.
    """
    n = len(readings)
    mean = math.fsum(readings) / n
    about_mean = math.fsum([(r - mean) ** 2 for r in readings])
    successive = math.fsum([(b - a) ** 2 for a, b in pairwise(readings)]) / 2.0
    return min(about_mean, successive) / (n - 1)


def _usual(now: Scattered, before: Sequence[Scattered]) -> float:
    """Variance of one reading that is usual here: the largest of three that a few odd points do not change.

    They are that of the quiet quarter of the points, each grown with the value to this one; that of all points but the
    noisiest tenth; and the middle one of the last few.
    """
    grown = sorted(_grown(one, now) for one in before)
    plain = sorted(one.variance for one in before)
    last = sorted(one.variance for one in list(before)[-_RECENT:])
    quiet, n = int(_QUIET * (len(grown) - 1)), len(grown)
    # of equally noisy points the quiet quarter is quiet by chance; the other two are not corrected, to be safe
    by_chance = _chi2(now.df, (quiet + 0.7) / (n + 0.4))
    return max(grown[quiet] / by_chance, plain[int(_ALL_BUT_ODD * (n - 1))], last[len(last) // 2])


def _grown(one: Scattered, to: Scattered) -> float:
    """Variance that a point may have at another point's value; infinite if a point at zero does not scatter at all."""
    growth = _growth(one, to)
    return one.variance * growth if growth < math.inf else growth  # not NaN, which no comparison sorts


def _growth(one: Scattered, to: Scattered) -> float:
    """Factor by which a variance may grow between two points: by the ratio of their values, squared.

    A value that is not larger than its noise counts as large as that.
    """
    size = max(one.size, _NEAR_ZERO_SDS * math.sqrt(one.variance))
    if to.size <= size:
        return 1.0
    return (to.size / size) ** 2 if size else math.inf


def _chi2(df: int, p: float) -> float:
    """Quantile of chi-squared over its degrees of freedom (Wilson and Hilferty, 1931)."""
    spread = 2.0 / (9.0 * df)
    return (1.0 - spread + NormalDist().inv_cdf(p) * math.sqrt(spread)) ** 3


def _digit(now: Scattered, before: Sequence[Scattered]) -> float:
    """One step of the last digit of readings, as far as these and earlier ones tell.

    Earlier readings are asked if these have too many digits to tell, or only a few: -10, -10, 10 may be 10.000. A
    meter with ranges has coarser digits at larger values.
    """
    if _COARSE * now.size >= now.digit > 0.0:
        return now.digit
    known = [(one.digit or one.step) * math.sqrt(_growth(one, now)) for one in before if one.digit or one.step]
    own = now.digit or (now.step if now.steps > 1 else 0.0) or (0.0 if known else _COARSE * now.size)
    return min([*([own] if own else []), *known], default=0.0)


def last_digit(value: float) -> float:
    """One step of the last digit of a reading; infinite if it has too many digits for a reading."""
    digits, _, power = f"{value:.11e}".partition("e")
    digits = digits.rstrip("0").replace(".", "").lstrip("-")
    return math.inf if len(digits) > _DIGITS else 10.0 ** (int(power) - len(digits) + 1)
