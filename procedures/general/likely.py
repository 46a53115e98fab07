"""Likely roles of the columns of a table, from names, units and values. They are proposals: nothing is done by them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rig.fitter.arithmetic import NAME
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import check_numbers
from rig.procedures.errors import DataError
from rig.procedures.evaluate.results import Source
from rig.procedures.general.clock_texts import is_clock
from rig.procedures.general.column_roles import Roles, read_roles
from rig.procedures.general.declared import Declared
from rig.procedures.general.directions import (
    are_directions,
    direction_option,
    likely_words,
    named_direction,
    read_direction,
)
from rig.procedures.general.first_model import alike, curved, nameless
from rig.procedures.general.fit import fit_general
from rig.procedures.general.models.units import unit_in
from rig.procedures.general.uncertain import option, uncertainties, weights
from rig.procedures.tables.file_rows import rows_of_file
from rig.procedures.tables.table import Table
from rig.procedures.tables.unknown_table import SeenColumn, UnknownTable

_TIME = re.compile(
    r"time|elapsed|timestamp|(^|[ _])(?-i:t)$|(^|[ _])t[ _(\[]+(s|sec|min|h)[)\]]?$|zeit|^date|\bdate$", re.IGNORECASE
)
_ORDER = re.compile(r"^(seq|sequence|order|reading|scan|n|no\.?|nr\.?|number|pt|point|run_?order)$", re.IGNORECASE)
_ROW = re.compile(r"^(row|row_?(names?|number|id)|index|id|unnamed: ?0|#)$", re.IGNORECASE)
_REPLICATE = re.compile(r"repl|^rep(eat)?s?$|cycle|series|trial|^run$|^pass$", re.IGNORECASE)
_GROUP = re.compile(
    r"whole_?plot|batch|block|group|operator|serial|sensor|channel|^day$|shape|type|"
    r"instrument|treatment|subject|worker|machine|specimen|device|^lot$|^lab(oratory)?$",
    re.IGNORECASE,
)
_RESPONSE = re.compile(
    r"output|reading|response|signal|indicat|bridge|voltage|volt|measured|meas\b|dut|uut|counts?|deflection|"
    r"(^|[ _(\[])(m|u|µ|n)?V(/V)?[)\]]?$|ohm|^y$|ausgang|anzeige",
    re.IGNORECASE,
)
_SETTING = re.compile(
    r"set|nominal|ref|load|force|applied|true|standard|^x$|press|mass|weight|temp|flow|level|kraft|druck|soll|"
    r"frequency|freq|wavelength|dark|_k?N$|dilution|conc",
    re.IGNORECASE,
)

OTHER_OUTPUT, _TOGETHER = "other output", 0.99
"""Role of a column that follows the setting as the response does, and the correlation from which it does."""
THE_SAME, _ALIKE = "the same quantity", 1e-9
"""Role of a column that is another one in another unit; how far it may be from a line in that one, by its span."""
_NARROW = 0.01
"""Span of a column relative to its values, below which its few levels are steps of a resolution."""


def likely(source: Source, table: Table) -> UnknownTable:
    """The columns of a table with likely roles, and options for a first fit and trace that were tried."""
    of = uncertainties(table)
    weighed = weights(table, of)
    roles = dict(_fixed(table, of))
    roles |= dict.fromkeys(weighed, "weight")
    free = [name for name in table.columns if name not in roles]
    times = tuple(name for name, role in roles.items() if role == "time")
    groups = [name for name, role in roles.items() if role in ("group", "direction") and "" not in _values(table, name)]
    numbered = [name for name, role in roles.items() if role in ("order", "row number") and not groups]
    if len(free) == 1:  # a quantity over time
        free = [*([one for one in times if one in table.columns] or numbered), *free]
        roles = {name: role for name, role in roles.items() if name not in free}
    tried = ""
    for response, terms in _pairs(table, free, groups, times):
        settings = [name for name in (*free, *groups) if {_quoted(name), f"C({_quoted(name)})"} & set(terms)]
        sensors = alike(response, [name for name in free if name not in settings], table)
        response = sensors[0]  # noqa: PLW2901 - the first of its sort
        numbers = [name for name in settings if name in free]
        try:
            fit_general(source.read, response, " + ".join(["1", *terms]), first_look=True)
            over_time = any(name in times for name in numbers)
            powers, curve = (terms, "") if over_time else curved(
                source, table, response, numbers, [_quoted(name) for name in numbers]
            )  # fmt: skip
            formula = " + ".join(["1", *terms, *powers[len(numbers) :]])
            fit, notes = _with_uncertainties(source, table, of, {"response": response, "formula": formula}, numbers)
            others = {name: role for name, role in roles.items() if f"C({_quoted(name)})" not in terms}
            trace = {"response": _quoted(response), "formula": formula, **_options(table, others)}
            trace, without = _readable(source, trace)
        except (DataError, FitError) as error:
            tried = tried or str(error)
            continue
        found = roles | dict.fromkeys(free, "covariate") | dict.fromkeys(settings, "setting")
        found |= dict.fromkeys(sensors, "response")
        outputs = [name for name in free if found[name] == "covariate" and _is_output(name, response, table)]
        found |= dict.fromkeys(outputs, OTHER_OUTPUT)
        same = {name: one for name in free if found[name] in ("covariate", OTHER_OUTPUT)
                for one in (response, *numbers) if _is_same(table.columns[name], table.columns[one])}  # fmt: skip
        found |= dict.fromkeys(same, THE_SAME)
        notes += [f"{name} is {one} again, in another unit or copied" for name, one in same.items()]
        notes += [f"{name} is a weight made of {one}" for name, one in weighed.items()]
        notes += _doubts(table, response, numbers, (*times, *numbered))
        beside = [name for name in (*sensors, *outputs, *same) if name != response and "," not in name]
        if beside:  # what they have in common with it is the setting's error
            trace["ignore"] = ",".join(beside)
        return UnknownTable(_columns(table, found), fit, trace, without, curve, sensors, tuple(dict.fromkeys(notes)))
    why = tried or f"it takes two columns of numbers that vary: a response and a setting{_nearly(table)}"
    return UnknownTable(_columns(table, roles | dict.fromkeys(free, "covariate")), {}, {}, why)


def _nearly(table: Table) -> str:
    """The first cell that is no number in each column of numbers; "" without one."""
    found = ""
    for name, cells in table.text.items():
        try:
            with rows_of_file(table):
                check_numbers(name, cells)
        except FitError as error:
            found += f"; {error}"
    return found


def _with_uncertainties(
    source: Source, table: Table, of: Mapping[str, str], fit: dict[str, str], settings: Sequence[str]
) -> tuple[dict[str, str], list[str]]:
    """Options of a fit with columns of standard uncertainties, if it can be fitted with them; and what to know."""
    u_y, note = option(table, of, fit["response"])
    notes = [note] if note else []
    if not u_y:
        return fit, notes
    given = {**fit, "u_y": u_y}
    u_x, note = option(table, of, settings[0]) if len(settings) == 1 else ("", "")
    try:
        fit_general(source.read, given["response"], declared=Declared(given["formula"], u_y=u_y), first_look=True)
    except (DataError, FitError) as error:
        return fit, [f"{notes[0]}, and not used: {error}"]
    if u_x:  # not tried: it is slow
        return {**given, "u_x": u_x}, [*notes, note]
    return given, [*notes, note] if note else notes


def _doubts(table: Table, response: str, settings: Sequence[str], times: Sequence[str]) -> Iterator[str]:
    """What to check, where neither names nor values show which column was set."""
    if nameless(table):
        yield "The columns have no names: please check which one was set and which one was read"
    elif any(name in times for name in settings):
        yield f"{response} was recorded over time and nothing else varies: this is no calibration, but shows a drift"
    elif settings and not any(_named_or_set(name, table) for name in settings):
        yield (
            "No column looks like a setting, by its name or by its values: please choose which one was set "
            "(--formula) and which one was read (--response)"
        )


def _is_same(one: FloatArray, other: FloatArray) -> bool:
    """Whether two columns are one quantity, in two units or twice."""
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < 3 or np.ptp(one[both]) == 0 or np.ptp(other[both]) == 0:
        return False
    x, y = one[both], other[both]
    return bool(np.abs(y - np.polynomial.Polynomial.fit(x, y, 1)(x)).max() <= _ALIKE * np.ptp(y))


def _is_output(name: str, response: str, table: Table) -> bool:
    """Whether a column is another output, of any unit: by its name or values, and because it follows the response."""
    measured = _merit(name, table) >= 2.0 or not _named_or_set(name, table)
    return measured and _follows(table.columns[name], table.columns[response]) > _TOGETHER


def _values(table: Table, name: str) -> list[Any]:
    return list({**table.columns, **table.text}[name].tolist())


def _readable(source: Source, trace: dict[str, str]) -> tuple[dict[str, str], str]:
    """Options of a trace whose roles can be read: without the time if that is why they cannot, and why.

    Raises:
        DataError, FitError: they cannot be read without the time either.
    """
    try:
        read_roles(source.read, _roles(trace))
    except (DataError, FitError) as error:
        timeless = {name: value for name, value in trace.items() if name not in ("time", "date")}
        if timeless == trace:
            raise
        read_roles(source.read, _roles(timeless))
        return timeless, str(error)
    return trace, ""


def _fixed(table: Table, of: Collection[str]) -> Iterator[tuple[str, str]]:
    """Columns whose role shows in their name or in their values."""
    taken: set[str] = set()
    for name, cells in table.text.items():
        given = [cell for cell in cells.tolist() if cell]
        levels = len(set(given))
        role = "text"
        if given and is_clock(given) and "time" not in taken:
            role = "date" if not any(":" in cell for cell in given) else "time"
        elif levels == 2 and (are_directions(given) or _words_of(table, name) is not None):
            role = "direction"
        elif 2 <= levels <= len(given) // 3:
            role = "group"
        taken.add(role)
        yield name, role
    for name, v in table.columns.items():
        known = v[np.isfinite(v)]
        distinct = np.unique(known)
        whole = bool(known.size) and bool((known == np.round(known)).all())
        if distinct.size < 2:
            yield name, "constant"
        elif named_direction(name, known):
            yield name, "direction"
        elif whole and _ORDER.search(name) and (np.diff(known) > 0).mean() > 0.7:
            yield name, "order"
        elif (whole and _ROW.search(name) and (np.diff(known) > 0).all()) or _counts_rows(name, table):
            yield name, "row number"
        elif name in of:
            yield name, "uncertainty"
        elif whole and distinct.size <= known.size // 2 and _REPLICATE.search(name):
            yield name, "replicate"
        elif whole and distinct.size <= known.size // 2 and _GROUP.search(name):
            yield name, "group"
        elif "time" not in taken and _TIME.search(name) and (np.diff(known) >= 0).mean() > 0.95:
            taken.add("time")
            yield name, "time"


def _words_of(table: Table, name: str) -> tuple[str, str] | None:
    """Words for up and down of a column of text, if they are no known ones, and go with the changes of a number."""
    settings = (v for v in table.columns.values() if np.isfinite(v).all())
    return likely_words(table.text[name].tolist(), settings) if name in table.text else None


def _counts_rows(name: str, table: Table) -> bool:
    """Whether a column is the number of the row, before others."""
    first = name == next(iter(table.columns)) and len(table.columns) > 2
    v = table.columns[name]
    counted = first and len(v) > 4 and v[0] in (0, 1) and bool((np.diff(v) == 1).all())
    return counted and not (_SETTING.search(name) or _TIME.search(name) or unit_in(name, table.units.get(name, "")))


def _pairs(
    table: Table, free: Sequence[str], groups: Sequence[str], times: Sequence[str]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Responses with the terms of settings, the likeliest first."""
    full = [name for name in free if np.isfinite(table.columns[name]).sum() >= max(3, 0.2 * len(table))]
    abscissa = _abscissa(table, full)
    responses = sorted(
        (name for name in full if name not in times and name != abscissa),
        key=lambda name: (-_merit(name, table), -_distinct(table.columns[name]), -full.index(name)),
    )
    for response in responses[:4]:
        sort = alike(response, full, table)
        others = [name for name in full if name not in sort] or [name for name in full if name != response]
        if not others:
            break
        if abscissa:
            yield response, (_quoted(abscissa),)
        named = [name for name in others if _named_or_set(name, table)]
        designed = [name for name in named if np.unique(table.columns[name]).size <= len(table) // 3]
        designed = [name for name in designed if not _is_narrow(table.columns[name])]
        strength = {name: round(_follows(table.columns[name], table.columns[response]), 9) for name in others}
        follows = sorted(others, key=lambda name: (_is_number_of(name, table), -strength[name]))
        likely = (name for name in follows if name in named and 2 * strength[name] >= strength[follows[0]])
        best = next(likely, follows[0])
        if 1 < len(designed) <= 4 and best in designed:
            yield response, tuple(map(_quoted, designed))
        yield response, (_quoted(best),)
        if follows[0] != best:
            yield response, (_quoted(follows[0]),)
    if len(full) == 1 and groups:
        yield full[0], tuple(f"C({_quoted(name)})" for name in groups)


def _abscissa(table: Table, full: Sequence[str]) -> str:
    """The first column, of a table without names, if it rises or falls throughout; "" for any other table."""
    first = table.names[0]
    if first not in full or len(full) < 2 or not nameless(table):
        return ""
    steps = np.diff(table.columns[first])
    return first if bool((steps > 0).all() or (steps < 0).all()) else ""


def _is_narrow(v: FloatArray) -> bool:
    """Whether the levels of a column are the steps of its resolution, as of a room's temperature."""
    known = v[np.isfinite(v)]
    return bool(np.ptp(known) < _NARROW * np.abs(known).max())


def _distinct(v: FloatArray) -> float:
    """Share of values that differ from all others, at most one half: measured ones rarely repeat."""
    return min(0.5, np.unique(v[np.isfinite(v)]).size / max(v.size, 1))


def _is_number_of(name: str, table: Table) -> bool:
    """Whether a column without unit or setting's name has the numbers 1 to k, each several times: of a subject, say."""
    levels = np.unique(table.columns[name])
    counted = 2 * levels.size <= len(table) and np.array_equal(levels, np.arange(1, levels.size + 1))
    return counted and not _SETTING.search(name) and not unit_in(name, table.units.get(name, ""))


def _merit(name: str, table: Table) -> float:
    """How likely a column is the response, by its name, its unit, and its values."""
    unit = table.units.get(name, "")
    electrical = bool(re.fullmatch(r"(m|u|µ|n)?V(/V)?|ohms?|Ω|counts?", unit))
    named = 2.0 * bool(_RESPONSE.search(name)) - bool(_SETTING.search(name))
    return named + 2.0 * electrical - 2.0 * _is_set(table.columns[name])


def _named_or_set(name: str, table: Table) -> bool:
    """Whether a column is a setting by its name, or by values that repeat or stand at even distances."""
    if _SETTING.search(name) and not _RESPONSE.search(name):
        return True
    return _is_set(table.columns[name]) and not _is_number_of(name, table)


def _is_set(v: FloatArray) -> bool:
    """Whether values look like those of a setting: few levels, or levels at even distances."""
    levels = np.unique(v[np.isfinite(v)])
    steps = np.diff(levels)
    even = levels.size > 3 and bool(np.allclose(steps, steps[0], rtol=1e-6))
    return even or 5 * levels.size <= len(v)


def _follows(one: FloatArray, other: FloatArray) -> float:
    """Size of the correlation of two columns, where both have values."""
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < 3 or np.ptp(one[both]) == 0 or np.ptp(other[both]) == 0:
        return 0.0
    with np.errstate(all="ignore"):
        found = abs(float(np.corrcoef(one[both], other[both])[0, 1]))
    return found if np.isfinite(found) else 0.0


def _options(table: Table, roles: Mapping[str, str]) -> dict[str, str]:
    """Options of a trace for the columns with fixed roles."""
    by_role: dict[str, list[str]] = {}
    for name, role in roles.items():
        full = name in table.text and "" not in table.text[name].tolist()
        if full or (name in table.columns and np.isfinite(table.columns[name]).all()):
            by_role.setdefault(role, []).append(name)
    found: dict[str, str] = {}
    if "time" in by_role:
        name = by_role["time"][0]
        found["time"] = name
        of_day = name in table.text and not any(
            "-" in c or "/" in c or c.count(".") > 1 for c in table.text[name].tolist()
        )
        if "date" in by_role and of_day:
            found["date"] = by_role["date"][0]
    elif "date" in by_role:
        found["time"] = by_role["date"][0]
    elif "order" in by_role:
        found["time"] = by_role["order"][0]
    for role in ("direction", "replicate", "group"):
        if role in by_role and "," not in by_role[role][0]:
            found[role] = by_role[role][0]
    if "direction" in found:
        found["direction"] = direction_option(found["direction"], _words_of(table, found["direction"]))
    return found


def _roles(options: Mapping[str, str]) -> Roles:
    group = (options["group"],) if "group" in options else ()
    direction, sides = read_direction(options["direction"]) if "direction" in options else (None, None)
    return Roles(
        options["response"], options["formula"], group=group, replicate=options.get("replicate"),
        time=options.get("time"), date=options.get("date"), direction=direction, sides=sides,
    )  # fmt: skip


def _quoted(name: str) -> str:
    """A column in a formula."""
    return name if re.fullmatch(NAME, name) else "`" + name.replace("`", "``") + "`"


def _columns(table: Table, roles: Mapping[str, str]) -> tuple[SeenColumn, ...]:
    return tuple(_column(name, roles.get(name, "text"), {**table.columns, **table.text}[name]) for name in table.names)


def _column(name: str, role: str, values: Any) -> SeenColumn:
    """A column with its values in words."""
    if values.dtype.kind == "f":
        given = values[np.isfinite(values)]
        levels = np.unique(given)
        said = f"{given.min():g} to {given.max():g}" if given.size else "none"
        if 1 < levels.size <= min(10, given.size // 2):
            said += f", {levels.size} levels"
        return SeenColumn(name, role, said, int(values.size - given.size))
    words = [one for one in values.tolist() if one]
    different = list(dict.fromkeys(words))
    said = ", ".join(one[:20] for one in different[:4])
    said += f", ... ({len(different)} different)" if len(different) > 4 else ""
    return SeenColumn(name, role, said, int(values.size - len(words)))
