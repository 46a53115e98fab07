"""A trace on one screen: error before and after, what was found, how sure it is, and what is next."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.fitter.trace.outcome import OF_METHOD
from rig.procedures.evaluate.front import firsts
from rig.procedures.evaluate.trace_shown import closing, opening
from rig.procedures.present.blocks import Block, Grid, Paragraph
from rig.procedures.present.joined import some
from rig.procedures.present.words import chance, constants_of, instead, share, size_of, unnamed

_NUMBER = re.compile(r"(?<![\w.-])\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w|\.\d)")
_CROWD = 4
"""Doubtful names that one shape may replace, from which on the shape is told first, and the names in one line."""

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome
    from rig.procedures.evaluate.results import Traced


def in_short(traced: Traced) -> Iterator[Block]:
    """The short form of a trace of any kind."""
    told = traced.to_json()
    yield from opening(told, traced.table)
    sensors = told["sensors"]
    yield _errors(traced.outcomes)
    yield from _crowds(sensors)
    yield from _effects(sensors)
    for name, sensor in sensors.items():
        rest = [
            *unnamed(sensor),
            "" if _crowd(sensor) else instead(sensor),
            *(one["sentence"] for one in sensor.get("refused") or ()),
        ]
        yield from (Paragraph(f"[yellow]{escape(name)}: {escape(text)}[/]", 2) for text in rest if text)
    yield from closing(told)
    yield from _notes(sensors)
    yield from _once([line for one in sensors.values() for line in _next(one)])


def _notes(sensors: Mapping[str, Any]) -> Iterator[Block]:
    """Notes but those of the method; one that is not of all sensors has their names."""
    of: dict[str, list[str]] = {}
    for name, sensor in sensors.items():
        for note in sensor["notes"]:
            if not note.startswith(OF_METHOD):
                of.setdefault(note, []).append(name)
    of = spanned(of)
    yield from _once(
        [note if len(names) == len(sensors) else f"{', '.join(names)}: {note}" for note, names in of.items()]
    )


def spanned(notes: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Notes, each with its sensors, of which those that differ in one number alone are one, from its least to its most.

    Example:
        >>> spanned({"about 0.3 Hz over 2 h": ["a"], "about 0.25 Hz over 2 h": ["b"], "odd": ["a"]})
        {'about 0.25 to 0.3 Hz over 2 h': ['a', 'b'], 'odd': ['a']}
    """
    alike: dict[tuple[str, ...], list[str]] = {}
    for note in notes:
        alike.setdefault(tuple(_NUMBER.split(note)), []).append(note)
    found: dict[str, list[str]] = {}
    for words, same in alike.items():
        each = list(zip(*(_NUMBER.findall(note) for note in same), strict=True))
        differ = [n for n, values in enumerate(each) if len(set(values)) > 1]
        if len(differ) != 1 or sum(len(notes[note]) for note in same) != len({s for note in same for s in notes[note]}):
            found |= {note: notes[note] for note in same}
            continue
        values = [values[0] for values in each]
        ends = sorted(each[differ[0]], key=float)
        values[differ[0]] = f"{ends[0]} to {ends[-1]}"
        told = "".join(part for pair in zip(words, [*values, ""], strict=True) for part in pair)
        found[told] = [sensor for note in same for sensor in notes[note]]
    return found


def _errors(outcomes: Sequence[Outcome]) -> Grid:
    """First error of every sensor, and that of rows left out, before and after."""
    labels, every = firsts(outcomes)
    grid = Grid(("", "", *map(escape, labels)))
    for outcome, rows in zip(outcomes, every, strict=True):
        # where nothing was found there is no after: the search was repeated for the rows left out alone
        changed = bool(outcome.findings)
        cells = ["" if row is None else f"{row.before} -> {row.after}" if changed else row.before for row in rows]
        grid.add_row(escape(outcome.sensor), escape(outcome.verdict), *cells)
    return grid


def _crowd(sensor: Mapping[str, Any]) -> Sequence[str]:
    """Many doubtful names in whose place one shape without a name may stand; () of few."""
    names: Sequence[str] = (sensor.get("instead") or {}).get("effects", ())
    return names if len(names) >= _CROWD else ()


def _crowds(sensors: Mapping[str, Any]) -> Iterator[Block]:
    """The shape in place of many doubtful names: that a part of the model is missing is sure, its names are not."""
    for name, sensor in sensors.items():
        if names := _crowd(sensor):
            one, effects = sensor["instead"], sensor["effects"]
            groups = {e["columns"][0] for e in effects if e.get("family") == "group"}
            over = one["shape"]["over"]["variable"]
            if over in groups:
                lacks = f"Levels of {over} that differ look like this: please give the model its levels, C({over})"
            else:
                lacks = "A curve that the declared model lacks looks like this: please choose a model that follows it"
            text = (
                f"no name is sure: one shape {one['where']}, {size_of(one['shape'])} rms, takes as much as "
                f"{len(names)} names together, which are all doubtful: {', '.join(names)} (--full). {lacks}"
            )
            yield Paragraph(f"[yellow]{escape(name)}: {escape(text)}[/]", 2)


def _effects(sensors: Mapping[str, Any]) -> Iterator[Block]:
    """Every effect once, with its cause; below it its size in each sensor that has it."""
    found: dict[str, list[tuple[str, Any]]] = {}
    for name, sensor in sensors.items():
        crowd = _crowd(sensor)
        for effect in sensor["effects"]:
            if effect["effect"] in crowd:
                continue
            found.setdefault(effect["effect"], []).append((name, effect))
    for effect, every in found.items():
        aliases = [some(one["aliases"], " or ") for _, one in every]
        alike = len(set(aliases)) == 1
        name = f"[green]{escape(effect)}[/]{_or(aliases[0]) if alike else ''}"
        yield Paragraph(f"{name}: {escape(every[0][1]['cause'])}", 2)
        for (sensor, one), others in zip(every, aliases, strict=True):
            interval = f" (95 %: {escape(one['size_95'])})" if one["size_95"] else ""
            of_all = "" if one["stratum"] == "noise" else f", {share(one)}"
            found_as = f"{escape(one['size'])}{interval}{of_all}, p {chance(one)}{'' if alike else f';{_or(others)}'}"
            constants = "".join(f", {escape(words)}" for words in _constants(one))
            yield Paragraph(f"{escape(sensor)}: {found_as}{constants}", 4)
            if one["doubtful"]:
                yield Paragraph(f"[yellow]doubtful: {escape(one['doubtful'])}[/]", 6)


def _constants(effect: Mapping[str, Any]) -> Iterator[str]:
    """Its searched constants; of those without a name the first term that has them, such as (time > 1898.5)."""
    yield from constants_of(effect)
    yield from (f"as {term}" for term in effect.get("searched", ())[:1])


def _or(others: str) -> str:
    return f" or {escape(others)}" if others else ""


def _next(sensor: Mapping[str, Any]) -> Iterator[str]:
    crowd = _crowd(sensor)
    for effect in sensor["effects"]:
        if effect["stratum"] != "noise" and effect["separate_by"] and effect["effect"] not in crowd:
            measure = str(effect["separate_by"]).split("; ")[0]  # without how much it would show in this sensor
            others = some(effect["aliases"])
            what = f"tell {effect['effect']} from {others}" if others else f"confirm {effect['effect']}"
            yield f"to {what}: {measure}"


def _once(lines: Sequence[str]) -> Iterator[Block]:
    """Lines that several sensors share stand once."""
    yield from (Paragraph(f"[dim]{escape(line)}[/]", 2) for line in dict.fromkeys(lines))
