"""Numbers of a trace before and after the effects, as text: the same rows on the terminal and on a page.

Each kind declares its rows in its `trace/result.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from rig.fitter.json_values import JsonValue
from rig.fitter.trace.outcome import Outcome, Row
from rig.procedures.present.numbers import number


@dataclass(frozen=True)
class Compared:
    """One row.

    Attributes:
        name: key of the row in JSON.
        label: its name for a person, with the displayed unit.
        before: value with the declared model.
        after: value with the effects.
        above: whether each of them is above its 95 % limit.
        meaning: explanation.
        setting: the setting, if there is a row for each of several; otherwise "".
        in_reports: whether only reports show it.
        share: value after over that before; None where they have none, or several.
    """

    name: str
    label: str
    before: str
    after: str
    above: tuple[bool, bool]
    meaning: str
    setting: str = ""
    in_reports: bool = False
    share: float | None = None


def compared(outcome: Outcome) -> Iterator[Compared]:
    """The rows that have a label, in their order."""
    for before, after in zip(outcome.before, outcome.after, strict=True):
        if not before.label or (before.where_known and before.value is None and after.value is None):
            continue
        above = _above(before), _above(after)
        settings = before.value if isinstance(before.value, Mapping) else {"": None}
        for setting in settings:
            yield Compared(
                before.name,
                before.label.format(setting) if setting else before.label,
                _text(before, setting),
                _text(after, setting),
                above,
                before.meaning,
                setting,
                before.in_reports,
                _share(before.value, after.value),
            )


def _share(before: JsonValue, after: JsonValue) -> float | None:
    if isinstance(before, float) and isinstance(after, float) and before > 0.0:
        return after / before
    return None


def _above(row: Row) -> bool:
    return row.limit is not None and isinstance(row.value, float) and row.value > row.limit


def _text(row: Row, setting: str) -> str:
    value: JsonValue = row.value.get(setting) if isinstance(row.value, Mapping) else row.value
    return number(value * row.scale, row.digits) if isinstance(value, (int, float)) else number(None)
