"""Roles of the columns of any table in a trace: response, settings, covariates, groups, time, direction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.fitter.arithmetic import quoted
from rig.fitter.arithmetic_text import column_name
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula, check_sizes
from rig.fitter.linear import orthonormal, spanned
from rig.procedures.column_names import beside, moves_of, read_at, with_word
from rig.procedures.errors import DataError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.general.clock_texts import is_clock
from rig.procedures.general.directions import approached_by, are_directions, direction_option, sides_of, with_changes
from rig.procedures.general.effects.kind import TableEffect
from rig.procedures.general.effects.own import missing_in
from rig.procedures.general.effects.scene import Grouping, Stood, TableScene
from rig.procedures.general.formula_settings import settings_of, subtracted
from rig.procedures.general.order import Parts, alike, identities, numbers_rows, time_of
from rig.procedures.general.own_time import seen_by
from rig.procedures.general.trace import TableData
from rig.procedures.present.meant import meant
from rig.procedures.tables.file_rows import rows_of_file
from rig.procedures.tables.moving import sentences
from rig.procedures.tables.table import Columns, Reader, Table

MOST_LEVELS, ROWS_A_LEVEL = 8, 6
"""Levels at most, and rows for each at least, of a column of text that is taken for a group without being declared."""


@dataclass(frozen=True)
class Roles:
    """The user's declarations about columns.

    Attributes:
        response: a column, or arithmetic of columns.
        formula: the declared model.
        group: columns whose levels may have their own offsets or gains.
        whole_plot: columns that together identify rows with a common error of the declared model.
        replicate: column of replications, whose offsets are declared too.
        time: column of the time.
        direction: column of +-1, of words such as up and down, of a velocity, or a setting whose changes give the
            direction of approach.
        sides: its words for up and for down, if they are not known ones.
        candidates: the only other columns to be used; None for all.
        ignore: columns not to be used.
        date: column of the dates of a time of day.
        date_order: "dmy" or "mdy", for dates that do not show it.
        wrap: period of the response, symmetric about zero; None if it is not an angle.
        own: what the laboratory adds: effects of any kind of calibration, and how often it found each.
        sensors: number of responses of the run that are traced: findings by chance are counted over all of them.
    """

    response: str
    formula: str
    group: tuple[str, ...] = ()
    whole_plot: tuple[str, ...] = ()
    replicate: str | None = None
    time: str | None = None
    direction: str | None = None
    candidates: tuple[str, ...] | None = None
    ignore: tuple[str, ...] = ()
    wrap: float | None = None
    date: str | None = None
    date_order: str | None = None
    own: Laboratory = NOTHING
    sensors: int = 1
    sides: tuple[str, str] | None = None

    @property
    def label(self) -> str:
        """The response for display: a column by its plain name."""
        return column_name(self.response)

    @property
    def named(self) -> tuple[str, ...]:
        """Columns with their own role, which are not covariates."""
        given = (self.replicate, self.time, self.date, self.direction)
        return (*self.group, *self.whole_plot, *(name for name in given if name is not None))


def with_response(read: Reader, roles: Roles) -> Roles:
    """The roles with a response that is no arithmetic in back-ticks, if it is a column: `Load cell (kN)`."""
    try:
        _parse("--response", f"0 + I({roles.response})")
        return roles
    except DataError:
        known = roles.response in read(()).columns
    return replace(roles, response=quoted(roles.response)) if known else roles


def read_roles(read: Reader, roles: Roles) -> tuple[Table, TableData, tuple[str, ...]]:
    """A CSV table, the same prepared for a trace, and sentences about the roles of columns.

    Raises:
        DataError: a column is missing, the formula cannot be read, or values do not fit their role.
    """
    formula = _parse("--formula", roles.formula)
    response = _parse("--response", f"0 + I({roles.response})")
    needed = dict.fromkeys([*response.names, *formula.names, *roles.named, *(roles.candidates or ())])
    table = read(needed)
    return (table, *roles_of(table, roles))


def roles_of(table: Table, roles: Roles) -> tuple[TableData, tuple[str, ...]]:
    """`read_roles` for a table that has been read; errors as there."""
    formula = _parse("--formula", roles.formula)
    response = _parse("--response", f"0 + I({roles.response})")
    try:
        return _roles(table, roles, formula, response)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def _roles(table: Table, roles: Roles, formula: Formula, response: Formula) -> tuple[TableData, tuple[str, ...]]:
    table = seen_by(table, roles.label)
    there = [*table.columns, *table.text, *table.gaps]
    missing = [name for name in roles.ignore if name not in there]
    if missing:
        raise FitError(
            f"--ignore: there is no column {missing[0]!r}; the table has {', '.join(there)}{meant(missing[0], there)}"
        )
    notes: list[str] = []
    free = _free(table, roles, (*formula.names, *response.names), notes)
    given = subtracted(response)
    categories = tuple(c.name for term in formula.terms for c in term.categories)
    parts = Parts(
        settings=(*formula.names, *given),
        groups=tuple(dict.fromkeys((*roles.group, *roles.whole_plot, *categories))),
        free=tuple(free),
        time=roles.time,
        direction=roles.direction,
        date=roles.date,
        date_order=roles.date_order,
        blocks=(*((roles.replicate,) if roles.replicate else ()), *roles.whole_plot),
        response=tuple(response.names)[:1] if len(response.names) == 1 else (),
    )
    time, along = time_of(table, parts, notes)
    order = np.arange(len(table)) if time is None else np.argsort(time.values, kind="stable")
    columns: dict[str, Any] = {name: v[order] for name, v in {**table.columns, **table.text}.items()}
    if time is not None:
        time = replace(time, values=time.values[order])
        free = [name for name in free if name != time.name and not alike(columns[name], time, notes, name)]
    with rows_of_file(table, order):
        y = response.columns(columns)[1][:, 0]
        names, exact = formula.exact_columns(columns)
        check_sizes(names, exact.hi)
    if roles.wrap is not None:
        y = (y + 0.5 * roles.wrap) % roles.wrap - 0.5 * roles.wrap
    if not names:
        raise FitError(f"the formula {roles.formula!r} has no terms: there is nothing to compare with")
    if len(y) <= len(names):
        raise FitError(f"{len(y)} rows are not enough for {len(names)} coefficients and an error")
    settings = settings_of(formula, columns)
    functions = frozenset(name for name in settings if name not in columns)
    unused = _unused_text(table, roles, (*formula.names, *response.names))
    if roles.direction is None and (seen := approached_by([*free, *unused], columns, settings)) is not None:
        roles, free = replace(roles, direction=seen), [name for name in free if name != seen]
        unused.pop(seen, None)
        notes.append(f"{seen} is taken for the side from which settings are approached; --ignore {seen} if not")
    read = _read_by_reference(parts.settings, table)
    few = _few_levels(table, unused)
    scene = TableScene(
        settings={
            **settings,
            **{name: np.asarray(columns[name], np.float64) for name in given if np.ptp(columns[name]) > 0},
        },
        covariates={n: columns[n] for n in free if np.ptp(columns[n]) > 0 and n not in read.values()},
        groups={
            **{name: _grouping(columns[name], declared=False) for name in (*roles.group, *few)},
            **{c.name: _grouping(columns[c.name], declared=True) for term in formula.terms for c in term.categories},
        },
        time=time,
        direction=_direction(roles, parts.settings, columns, ordered=time is not None),
        speed=_speed(roles, parts.settings, columns),
        setpoints={name: np.asarray(columns[setpoint], np.float64) for name, setpoint in read.items()},
        moves={name: Stood(*found) for name in (*settings, *free) if (found := _moves(name, columns)) is not None},
        functions=functions,
    )
    labels = {name: _grouping(columns[name], declared=False) for name in _levels(table, unused) if name not in few}
    scene = replace(scene, own=tuple(_testable(scene, roles.own, notes)), history=roles.own.history, labels=labels)
    notes.extend(_not_looked_at(table, unused))
    shared = roles.whole_plot or ((roles.replicate,) if roles.replicate else ())
    hi, lo = exact.hi, exact.lo
    if roles.whole_plot and roles.replicate:
        extra = _grouping(columns[roles.replicate], declared=True).indicators[:, 1:]
        names = (*names, *(f"C({roles.replicate})[{i + 1}]" for i in range(extra.shape[1])))
        hi, lo = np.hstack([hi, extra]), np.hstack([lo, np.zeros_like(extra)])
    basis = orthonormal(hi)
    curved = frozenset(name for name, v in scene.settings.items() if not spanned(v, basis))
    scene = replace(scene, constant=spanned(np.ones(len(hi)), basis), curved=curved)
    data = TableData(
        response=roles.label,
        y=np.asarray(y, np.float64),
        formula=str(formula),
        names=names,
        columns=hi,
        tails=lo,
        scene=scene,
        shared=identities(columns, shared) if shared else None,
        points=_points(formula, columns, roles.group),
        order_unknown=along,
        numbers=table.numbers[order],
        sensors=roles.sensors,
        shares="whole plots" if roles.whole_plot or not roles.replicate else "replications",
        moving=sentences(table.moving, roles.label, settings),
    )
    return data, tuple(notes)


def _testable(scene: TableScene, own: Laboratory, notes: list[str]) -> Iterator[TableEffect]:
    """The laboratory's own effects of tables whose columns this table has; the others are noted."""
    for effect in with_own((), own, TableEffect):
        missing = missing_in(scene, effect)
        if missing:
            notes.append(f"{effect.name} was not tested: {missing[0]} is no setting, covariate or time of this table")
        else:
            yield effect


def _parse(option: str, text: str) -> Formula:
    try:
        return Formula.parse(text)
    except FitError as error:
        raise DataError(f"{option}: {error}") from error


def _free(table: Table, roles: Roles, used: Sequence[str], notes: list[str]) -> list[str]:
    """Columns of numbers without another role: the covariates, but for numbers of rows, which are noted."""
    if roles.candidates is not None:
        for name in roles.candidates:
            if name not in table.columns:
                raise FitError(f"--candidates: {name} is text; as a grouping it goes with --group")
            if name in roles.ignore:
                raise FitError(f"--candidates and --ignore both name {name}: leave out one of them")
        return [name for name in roles.candidates if name not in used]
    taken = {*used, *roles.named, *roles.ignore, *(other for name in table.columns for other in beside(name))}
    free = [name for name in table.columns if name not in taken]
    counts = [name for name in free if numbers_rows(name, table.columns[name])]
    notes.extend(f"{name} numbers the rows of the file and was not looked at" for name in counts)
    return [name for name in free if name not in counts]


def _moves(name: str, columns: Columns) -> tuple[FloatArray, FloatArray | None] | None:
    """The columns of `Stood`; None if they are not recorded."""
    since, start = moves_of(name)
    known = since in columns and bool(np.all(np.isfinite(columns[since])))
    return (columns[since], columns.get(start)) if known else None


def _unused_text(table: Table, roles: Roles, used: Sequence[str]) -> dict[str, int]:
    """Columns of text without a role that differ between rows, with the number of their levels."""
    told = {*used, *roles.named, *roles.ignore}
    names = () if roles.candidates is not None else table.text
    counts = {name: len(np.unique(table.text[name])) for name in names if name not in told}
    return {name: count for name, count in counts.items() if count > 1}


def _levels(table: Table, unused: Mapping[str, int]) -> list[str]:
    """Those whose levels repeat, and are no clock."""
    return [n for n, count in unused.items() if 2 * count <= len(table) and not is_clock(table.text[n].tolist())]


def _few_levels(table: Table, unused: Mapping[str, int]) -> list[str]:
    """Those of few levels and many rows, such as two operators: they are groups that nobody declared."""
    return [n for n in _levels(table, unused) if unused[n] <= MOST_LEVELS and ROWS_A_LEVEL * unused[n] <= len(table)]


def _not_looked_at(table: Table, unused: Mapping[str, int]) -> list[str]:
    """A sentence about each unused column of text that differs between rows."""
    found = []
    for name in unused:
        if is_clock(table.text[name].tolist()):
            found.append(f"{name} holds text and was not looked at; --time {name} if it is the time")
        elif name in _few_levels(table, unused):
            found.append(f"{name} holds text: its {unused[name]} levels are taken for a group; --ignore {name} if not")
        elif name in _levels(table, unused):
            found.append(f"{name} holds text: no effect of it was tested, only shapes without a name; --group {name}")
        else:
            found.append(f"{name} holds text and was not looked at, and hardly repeats")
    return found


def parts_played(data: TableData) -> dict[str, Any]:
    """The role of each column, as JSON values."""
    scene = data.scene
    return {
        "settings": list(scene.settings),
        "covariates": list(scene.covariates),
        "groups": list(scene.groups),
        "time": None if scene.time is None else scene.time.name,
        "direction": None if scene.direction is None else scene.direction[0],
        **({"read by a reference": list(scene.setpoints)} if scene.setpoints else {}),
    }


def used_columns(roles: Roles, parts: Mapping[str, Any]) -> set[str]:
    """Used columns, from `parts` of `parts_played`."""
    named = {*_parse("--formula", roles.formula).names, *_parse("--response", f"0 + I({roles.response})").names}
    setpoints = {_setpoint_of(name) for name in parts.get("read by a reference", ())}
    direction = (parts["direction"] or "").partition("(")[2].removesuffix(")")
    setpoints |= {move for name in (*parts["settings"], *parts["covariates"]) for move in moves_of(name)}
    times = {read_at(roles.label), parts["time"] or ""}
    return (named | setpoints | times | {*roles.named, *parts["covariates"], direction}) - {""}


def _read_by_reference(settings: Sequence[str], table: Table) -> dict[str, str]:
    """Columns of setpoints, by the settings that a reference standard read: `force_set_kN` beside `force_kN`."""
    pairs = {name: _setpoint_of(name) for name in settings}
    return {name: setpoint for name, setpoint in pairs.items() if setpoint in table.columns}


def _setpoint_of(name: str) -> str:
    return with_word(name, "set")


def _direction(
    roles: Roles, settings: Sequence[str], columns: Mapping[str, Any], *, ordered: bool
) -> tuple[str, FloatArray] | None:
    if roles.direction is None:
        return None
    v = columns[roles.direction]
    if v.dtype.kind not in "fiu":
        v = _sides_in(roles, v.tolist())
    if roles.direction not in settings:
        side = np.sign(v)
        if len(np.unique(side)) < 2:
            raise FitError(f"--direction: {roles.direction} has one sign only; there is nothing to compare")
        if ordered and len(np.unique(np.abs(v))) < 3:  # no velocity, whose zero is rest
            every = (columns[one] for name in settings for one in (_setpoint_of(name), name) if one in columns)
            side = with_changes(side, every)
        return f"sign({roles.direction})", side
    asked = _setpoint_of(roles.direction)  # readings of a standard also change where the setting stays
    name, v = (asked, columns[asked]) if asked in columns else (roles.direction, v)
    return f"side({name})", with_changes(np.sign(np.diff(v, prepend=v[:1])), [v])


def _sides_in(roles: Roles, cells: Sequence[str]) -> FloatArray:
    """(n,) +1 or -1 of the words in the column of direction. Raises `FitError` for another word."""
    levels = list(dict.fromkeys(cells))
    if roles.sides is not None:
        other = next((word for word in levels if word not in roles.sides), None)
        if other is not None:
            given = direction_option(str(roles.direction), roles.sides)
            raise FitError(f"--direction {given}: {roles.direction} has {other[:40]!r} too")
        return np.array([1.0 if cell == roles.sides[0] else -1.0 for cell in cells])
    if not are_directions(levels):
        other = next(word for word in levels if not are_directions([word]))
        pair = ",".join(levels) if len(levels) == 2 and "," not in "".join(levels) else "UP,DOWN"
        raise FitError(
            f"--direction: {roles.direction} has {other[:40]!r}; give +1 and -1, up and down (or increasing and "
            f"decreasing, loading and unloading), a velocity or a setting; or say which word is up: --direction "
            f"'{roles.direction}={pair}', the upward one first"
        )
    return sides_of(cells)


def _speed(roles: Roles, settings: Sequence[str], columns: Mapping[str, Any]) -> tuple[str, FloatArray] | None:
    """The column of direction, if it is a velocity and not only a sign."""
    name = roles.direction
    if (
        name is None
        or name in settings
        or columns[name].dtype.kind not in "fiu"
        or len(np.unique(np.abs(columns[name]))) < 3
    ):
        return None
    return name, np.asarray(columns[name], np.float64)


def _grouping(values: Any, *, declared: bool) -> Grouping:
    levels, index = np.unique(values, return_inverse=True)
    return Grouping(
        tuple(f"{v:g}" if levels.dtype.kind == "f" else str(v) for v in levels), index.astype(np.int64), declared
    )


def _points(formula: Formula, columns: Mapping[str, Any], group: Sequence[str]) -> IntArray | None:
    """(n,) groups of rows that repeat one setting; None without settings."""
    names = tuple(dict.fromkeys((*formula.names, *group)))
    return identities(columns, names) if formula.names else None
