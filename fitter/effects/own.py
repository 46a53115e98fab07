"""A laboratory's own effects, written as formulas in a TOML text; they extend the catalogues without changing them.

    [[effect]]
    name = "draught"
    cause = "a draught from the door cools one side of the package while it looks there"
    scope = "sensor"
    stratum = "between-point"
    unit = "V"
    columns = ["exp(cos(pitch))*sin(3*roll)"]
    separate_by = "close the door"
    usual_size = "1e-5 V"
    by_hand = { change = "door-closed", say = "close the door", does = "removes" }

    [history]
    calibrations = 24
    confirmed = { draught = 9, gear-pitch = 3 }

`history` may be left out: number of the laboratory's calibrations with a further run, and of those in which it
confirmed an effect. Of names that data cannot tell apart, the more probable one by data and history is then reported.
`by_hand` may be left out: a change by a person that removes or resizes the effect. The stratum determines the kind of
calibration of the effect. Each kind defines its strata, its scopes and the variables of columns in a `Grammar`; the
arithmetic is that of `rig.fitter.arithmetic`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from rig.fitter.effects.entry import Entry
from rig.fitter.effects.history import History, Laboratory
from rig.fitter.effects.manual_changes import ByHand, Change
from rig.fitter.effects.own_formula import OwnFormula
from rig.fitter.effects.sizes import each
from rig.fitter.errors import FitError

_HAND, _CHANGE, _DOES = "by_hand", ("change", "say", "does"), ("removes", "resizes")
_WORDS = ("name", "cause", "scope", "stratum", "unit", "columns", "separate_by", "usual_size")


@dataclass(frozen=True)
class Grammar:
    """Grammar of effects of one kind of calibration.

    Attributes:
        strata: possible strata; no other kind has the same.
        scopes: possible scopes of one coefficient.
        names: variables of columns.
        make: makes the entry from its fields and its columns.
    """

    strata: tuple[str, ...]
    scopes: tuple[str, ...]
    names: Collection[str]
    make: Callable[[Mapping[str, Any], Sequence[OwnFormula]], Entry]


def own_effects(text: str, grammars: Sequence[Grammar]) -> Laboratory:
    """Effects and their history, written in TOML, of any of the kinds whose grammars are given.

    Args:
        text: `[[effect]]` tables and `[history]`, as at the head of this module.
        grammars: of the kinds of calibration; `GRAMMAR` of the module `effects.own` of each.

    Raises:
        FitError: it is not TOML, a field is missing or unknown, or a column is not a formula; the message names it.

    Example:
        >>> from rig.procedures.general.effects.own import GRAMMAR
        >>> text = '''
        ... [[effect]]
        ... name = "draught"
        ... cause = "a draught cools the cell while the door is open"
        ... scope = "sensor"
        ... stratum = "row"
        ... unit = "mV"
        ... columns = ["exp(-x_mm)"]
        ... separate_by = "close the door"
        ... usual_size = "0.1 mV"
        ... '''
        >>> [effect.name for effect in own_effects(text, [GRAMMAR]).effects]
        ['draught']
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FitError(f"it is no TOML: {error}") from error
    except RecursionError:
        raise FitError("it is nested too deeply to be a file of effects") from None
    effects, history = tables.pop("effect", []), tables.pop("history", None)
    if tables or not isinstance(effects, list) or not (effects or history):
        raise FitError("a file of effects has [[effect]] tables, [history], or both, and nothing else")
    return Laboratory(tuple(_effect(table, grammars) for table in effects), _history(history))


def _history(table: Any) -> History:
    if table is None:
        return History()
    if not isinstance(table, Mapping) or set(table) != {"calibrations", "confirmed"}:
        raise FitError("[history] has calibrations, a number, and confirmed, a table of numbers by name of the effect")
    calibrations, confirmed = table["calibrations"], table["confirmed"]
    if not _count(calibrations) or not calibrations or not isinstance(confirmed, Mapping):
        raise FitError(f"[history]: calibrations is a number from 1 on, confirmed a table, not {table!r:.80}")
    for name, count in confirmed.items():
        if not _count(count) or count > calibrations:
            raise FitError(f"[history]: {name} was confirmed in 0 to {calibrations} calibrations, not {count!r:.40}")
    return History(calibrations, dict(confirmed))


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _effect(table: Any, grammars: Sequence[Grammar]) -> Entry:
    if not isinstance(table, Mapping):
        raise FitError(f"an effect is a table, [[effect]], not {table!r:.40}")
    name = table.get("name", "without a name")
    if set(table) - {_HAND} != set(_WORDS):
        wrong = sorted((set(table) - {_HAND}) ^ set(_WORDS))
        raise FitError(f"effect {name}: missing or unknown: {', '.join(wrong)}; it has {', '.join(_WORDS)}")
    for field in _WORDS:
        if field != "columns" and (not isinstance(table[field], str) or not table[field]):
            raise FitError(f"effect {name}: {field} is a text, not {table[field]!r:.40}")
    if not isinstance(table["columns"], list) or not table["columns"]:
        raise FitError(f"effect {name}: columns is a list of formulas, not {table['columns']!r:.40}")
    grammar = next((one for one in grammars if table["stratum"] in one.strata), None)
    if grammar is None:
        _refuse(name, "stratum", table["stratum"], [stratum for one in grammars for stratum in one.strata])
    if table["scope"] not in grammar.scopes:
        _refuse(name, "scope", table["scope"], grammar.scopes)
    formulas = [OwnFormula.of(name, column, grammar.names) for column in table["columns"]]
    fields: dict[str, Any] = {key: table[key] for key in _WORDS if key != "columns"}
    if _HAND in table:
        fields["manual_changes"] = (_by_hand(name, table[_HAND]),)
    return grammar.make(fields | {"size": each(table["unit"]), "known_aliases": {}, "own": True}, formulas)


def _by_hand(name: str, told: Any) -> ByHand:
    """Influence of a change by a person on it. Raises `FitError`."""
    words = told if isinstance(told, Mapping) else {}
    texts = all(isinstance(value, str) and value for value in words.values())
    if set(words) != set(_CHANGE) or not texts or words["does"] not in _DOES:
        raise FitError(
            f"effect {name}: by_hand is a table with {', '.join(_CHANGE)}, all texts; does is {' or '.join(_DOES)}"
        )
    return ByHand(Change(words["change"], words["say"]), words["does"])


def _refuse(name: str, field: str, value: str, allowed: Sequence[str]) -> NoReturn:
    raise FitError(f"effect {name}: {field} is {' or '.join(allowed)}, not {value!r}")
