"""A sentence or a number of the paper beside what is computed, and whether the two agree."""

from __future__ import annotations

from dataclasses import dataclass

SMALL = 10.0
"""What "insignificant", "nearly constant", "small" are taken to mean, in percent; "significant" is more than this."""


@dataclass(frozen=True)
class Statement:
    """One of them.

    Attributes:
        where: figure, table or section of NASA/TP-1999-209835.
        says: what it says there, shortened.
        printed: as printed; empty where the paper gives no number.
        computed: the same quantity as computed here.
        difference: computed less printed; empty where there is no number.
        criterion: what agreement means.
        agrees: whether it is met.
        note: why not, or what else there is to say.

    """

    where: str
    says: str
    printed: str
    computed: str
    difference: str
    criterion: str
    agrees: bool
    note: str = ""


def digits(
    where: str, says: str, printed: float, computed: float, decimals: int, unit: str = "", note: str = ""
) -> Statement:
    """A printed number that must come out in all its printed digits.

    Args:
        where: figure, table or section.
        says: what the number is.
        printed: the number.
        computed: the same, computed.
        decimals: how many the print has.
        unit: of both.
        note: to be shown beside it.

    """
    shown = decimals + 1 if decimals else 0
    return Statement(
        where,
        says,
        _number(printed, decimals, unit),
        _number(computed, shown, unit),
        _difference(computed - printed, shown),
        "printed digits",
        bool(round(computed, decimals) == round(printed, decimals)),
        note,
    )


def about(
    where: str, says: str, printed: float, computed: float, room: float, unit: str = "", note: str = ""
) -> Statement:
    """A number the paper gives in words ("approximately 15 percent"): within `room` of it, in its own unit."""
    return Statement(
        where,
        says,
        _number(printed, 0 if printed == round(printed) else 3, unit),
        _number(computed, 1 if unit == "%" else 3, unit),
        _difference(computed - printed, 1 if unit == "%" else 3),
        f"within {room:g}{_gap(unit)}",
        bool(abs(computed - printed) <= room),
        note,
    )


def below(
    where: str, says: str, computed: float, limit: float, unit: str = "", note: str = "", *, printed: str = ""
) -> Statement:
    """Something the paper calls small, insignificant, constant: less than `limit`. `printed`: where it has a number."""
    return _held(where, says, computed, f"< {limit:g}", bool(computed < limit), unit, note, printed)


def above(
    where: str, says: str, computed: float, limit: float, unit: str = "", note: str = "", *, printed: str = ""
) -> Statement:
    """Something the paper calls large, significant, unbounded: more than `limit`."""
    return _held(where, says, computed, f"> {limit:g}", bool(computed > limit), unit, note, printed)


def between(where: str, says: str, computed: float, limits: tuple[float, float], *, printed: str = "") -> Statement:
    """A size that is to be like the paper's."""
    low, high = limits
    return _held(where, says, computed, f"{low:g} to {high:g}", bool(low <= computed <= high), "", "", printed)


def _held(
    where: str, says: str, computed: float, criterion: str, agrees: bool, unit: str, note: str, printed: str
) -> Statement:
    return Statement(
        where, says, printed, f"{short(computed)}{_gap(unit)}", "", f"{criterion}{_gap(unit)}", agrees, note
    )


def _difference(value: float, decimals: int) -> str:
    """Without the sign of a zero, which another machine may have otherwise."""
    return f"{round(value, decimals) + 0.0:+.{decimals}f}" if round(value, decimals) else "0"


def _gap(unit: str) -> str:
    return f" {unit}" if unit else ""


def _number(value: float, decimals: int, unit: str) -> str:
    return f"{value:.{decimals}f}{_gap(unit)}"


def short(value: float) -> str:
    """Three digits, thousands written out. Rounding errors count as nothing: another machine has others."""
    if abs(value) <= 1e-9:
        return "0"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
