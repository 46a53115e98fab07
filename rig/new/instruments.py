"""Instruments that can be named for a part of a first bench, by their roles: installed drivers, and files.

No instrument is named here. A driver is opened on a wire that leads nowhere, only to ask it for channels, units and
limits: nothing is sent.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, TypeAdapter, ValidationError

from rig.bench.config import validated
from rig.bench.contract_files import with_contracts
from rig.bench.plugins import driver_class, drivers, is_file
from rig.drivers.clock import RealClock
from rig.drivers.roles import ByHand, Chamber, Head, PressureController, Reader, Source, WithUnits
from rig.errors import ConfigurationError, RigError
from rig.new.answers import NONE, Answers, option, span
from rig.procedures.column_names import spelled, unit_of
from rig.units.of_instruments import HEAD_AXES, PRESSURE_UNIT, TEMPERATURE_UNIT, VOLT, scale
from rig.verbs.instrument.catalogue import text_named

SETS, STANDARD, READS, CHAMBER, THERMOMETER = "sets", "standard", "reads", "chamber", "thermometer"
PARTS = (SETS, STANDARD, READS, CHAMBER, THERMOMETER)
"""Parts of a bench that an instrument is named for."""

_TAKES: Mapping[str, tuple[type, ...]] = {
    SETS: (ByHand, Source, PressureController, Chamber, Head),
    STANDARD: (Reader,),
    READS: (Reader,),
    CHAMBER: (Chamber, Source),
    THERMOMETER: (Reader,),
}
_MODEL = "MODEL"
_READ = (READS, STANDARD, THERMOMETER)
_NOTHING: Mapping[str, str] = {
    CHAMBER: "nothing: at the temperature of the room",
    THERMOMETER: "no other one: the chamber's own reading is used",
}
_ASKED = ("model", "on", "off", "output")
"""Options that are asked for, although they have a default: without them most instruments are refused."""
_MORE: Mapping[str, tuple[Any, str]] = {
    "maker": ("MAKER", "as *IDN? says it; another instrument is refused"),
    "check": ({"UNIT?": "V"}, "questions and answers that show a change at its panel"),
    "start": ("SAMP:COUN {count};:INIT", "if it keeps readings: all meters then start together,"),
    "fetch": ("FETC?", "and are asked for them; READ? takes one after the other"),
    "read": ("READ?", "if it reads back: settled within its tolerance"),
    "tolerance": (0.1, "of that, in its unit"),
    "time_constant_s": (300, "how it approaches a setting: for forecasts and dry runs"),
}
"""Options that instruments of one's own often need and do not have to have: an example, and what it is for."""
_READS_BACK: Mapping[str, str] = {
    "read": "where it stands now; a chamber that cannot say so: leave out this and the next two lines",
    "tolerance": "settled within this of its setting",
    "time_constant_s": "how it approaches a setting: for forecasts and dry runs",
}
"""A chamber has these from the beginning: a run that waits for a temperature has to know when it is there."""
_WORDS = {"V": "VOLT", "A": "CURR", "degC": "TEMP"}


class _Nowhere:
    """A wire, and all that is done with it: nothing."""

    def __getattr__(self, name: str) -> _Nowhere:
        return self

    def __call__(self, *_: Any, **__: Any) -> _Nowhere:
        return self

    def __str__(self) -> str:
        return "nowhere"


def driver(name: str) -> type[Any]:
    """The driver of a name, or of a file's path as it is now. Raises `RigError`."""
    return _driver(text_named(str(Path(name).expanduser()))[0] if is_file(name) else name)


@cache
def _driver(name: str) -> type[Any]:
    found: Any = driver_class(name)
    return cast(type, found)


def plays(name: str, *roles: type) -> bool:
    """Whether an instrument has one of these roles."""
    return issubclass(driver(name), roles)


def by_hand(name: str) -> bool:
    """Whether it is a person."""
    return plays(name, ByHand)


def opened(name: str, options: Mapping[str, Any]) -> Any:
    """Its driver on a wire that leads nowhere; None if these options do not make one."""
    cls = driver(name)
    try:
        checked = cls.Options.model_validate(_with(name, options))
        return cls("instrument", "/dev/rig/nowhere", checked, _Nowhere(), RealClock())
    except Exception:
        return None


def _with(name: str, options: Mapping[str, Any]) -> dict[str, Any]:
    cls = driver(name)
    if is_file(name):
        return {**getattr(cls, "supplied", {}), **options}
    return with_contracts(name, options)


def channels(name: str, options: Mapping[str, Any], unit: str) -> list[str] | None:
    """Channels of a reader that give a unit, with any prefix; None if it cannot be asked without its wire."""
    found = opened(name, options)
    if found is None:
        return None
    units = found.units() if isinstance(found, WithUnits) else {}
    return [one for one in found.channels() if scale(units.get(one, VOLT), unit) is not None]


def sets_unit(name: str, options: Mapping[str, Any]) -> str:
    """The only unit that it sets; "" for any, or if it cannot be asked."""
    if plays(name, PressureController):
        return PRESSURE_UNIT
    if plays(name, Chamber):
        return TEMPERATURE_UNIT
    if plays(name, Head):
        return "deg"
    found = opened(name, options) if plays(name, Source) else None
    return "" if found is None else str(found.unit())


def unsuitable(part: str, name: str, answers: Answers) -> str:
    """Why an instrument cannot be named for a part, as a sentence; "" if it can."""
    if not plays(name, *_TAKES[part]):
        return f"{name} {'reads nothing' if part in _READ else 'sets nothing'}"
    if plays(name, Head) and answers["quantity"] not in HEAD_AXES:
        return f"{name} sets {' or '.join(HEAD_AXES)}; call what you set so"
    options = {**widened(part, name, answers), **suggested(part, name, answers)}
    if part in _READ:
        wanted = unit_of_part(part, answers)
        found = None if by_hand(name) else channels(name, options, wanted)
        return "" if found is None or found else f"{name} does not read {spelled(wanted)}"
    wanted = unit_of_part(part, answers)
    own = sets_unit(name, options)
    if own not in ("", wanted):
        return f"{name} sets {spelled(own)}, not {spelled(wanted)}"
    values, reach = answers.get(_LEVELS[part]), opened(name, options)
    if values and reach is not None and hasattr(reach, "limits"):
        low, high = reach.limits()
        if min(values) < low or max(values) > high:
            return f"{name} goes from {low:g} to {high:g}, and the levels are {span(values, wanted)}"
    return ""


def unit_of_part(part: str, answers: Answers) -> str:
    """The unit in which a part of the bench sets or reads."""
    if part == STANDARD:
        return unit_of(answers[STANDARD])
    return str({SETS: answers["sets_in"], READS: answers.get("reads_in", VOLT)}.get(part, TEMPERATURE_UNIT))


def meters(answers: Answers) -> int:
    """How many instruments read what is calibrated: one for each sensor, if one has a single channel."""
    name = answers["reads_with"]
    if by_hand(name):
        return 1
    there = channels(name, suggested(READS, name, answers), answers["reads_in"])
    return int(answers["channels"]) if there is not None and len(there) == 1 else 1


def more(part: str, name: str, answers: Answers) -> Iterator[tuple[str, Any, str, bool]]:
    """Options of an instrument described in the bench file that it may need, too.

    Yields:
        Key, example, what it is for, and whether it is used from the beginning.
    """
    fields, unit = driver(name).Options.model_fields, unit_of_part(part, answers)
    own = {"check": {"UNIT?": unit.upper()}} | ({} if unit == TEMPERATURE_UNIT else {"time_constant_s": 0.5})
    for key, (example, words) in _MORE.items() if asked(name) else ():
        if key in fields and not fields[key].is_required():
            used = part == CHAMBER and key in _READS_BACK
            yield key, own.get(key, example), _READS_BACK[key] if used else words, used


_LEVELS = {SETS: "levels", CHAMBER: "chamber_degC"}


def offered(part: str, answers: Answers) -> dict[str, str]:
    """Instruments for a part of the bench, by driver name, each with what it is."""
    found = {NONE: _NOTHING[part]} if part in _NOTHING else {}
    for name in drivers():
        with contextlib.suppress(ConfigurationError):  # of another package, and it cannot be loaded
            if not unsuitable(part, name, answers):
                found[name] = _about(name)
    return found


def _about(name: str) -> str:
    """What its file says that it is, or the first line of its module's documentation."""
    cls = driver(name)
    if table := getattr(cls, "table", None):
        return f"{table.maker} {', '.join(table.model)}: {table.about}"
    return (sys.modules[cls.__module__].__doc__ or name).strip().splitlines()[0].rstrip(".")


def make(name: str, options: Mapping[str, Any]) -> tuple[str, str]:
    """Maker and model of an instrument as they were said, or as its file has them; "" for what nobody said."""
    table = getattr(driver(name), "table", None)
    own = (table.maker, table.model[0] if len(table.model) == 1 else "") if table is not None else ("", "")
    said = (str(options.get(key, "")) for key in ("maker", "model"))
    maker, model = (one or other for one, other in zip(said, own, strict=True))
    return maker, "" if model == _MODEL else model


def reading_s(name: str) -> float:
    """Seconds that one reading takes by the instrument's file; 0 if it says nothing."""
    reader = getattr(getattr(driver(name), "table", None), "reader", None)
    return float(reader.reading_s) if reader is not None else 0.0


def named(part: str, given: Any, answers: Answers) -> str:
    """A driver, by its name, its number among the offered ones, or the path of its file. Raises `ValueError`."""
    there, name = offered(part, answers), str(given).strip()
    if name.isdigit() and 1 <= int(name) <= len(there):
        return list(there)[int(name) - 1]
    if name in there:
        return name
    possible = f"possible are {', '.join(there)}, or your own file, ./NAME.toml (`rig instrument new`)"
    try:
        why = unsuitable(part, name, answers)
    except RigError as error:
        why = str(error) if is_file(name) else f"{name!r:.60} is not installed"
    if why or not is_file(name):
        raise ValueError(f"{why}; {possible}")
    return name


def suggested(part: str, name: str, answers: Answers) -> dict[str, Any]:
    """Options that follow from the other answers, and suggestions for those that it needs."""
    cls = driver(name)
    fields = cls.Options.model_fields
    unit = unit_of_part(part, answers)
    values = answers.get(_LEVELS.get(part, ""), [0.0, 1.0])
    low, high = min(0.0, *values), max(0.0, *values)
    word = _WORDS.get(unit, "SOUR")
    count = int(answers.get("channels", 1)) if part == READS else 1
    every = {
        "unit": unit,
        "low": low,
        "high": high,
        "set": f"{word} {{value}}",
        "setpoint": f"{word}?",
        "model": _MODEL,
        "on": "OUTP ON",
        "off": "OUTP OFF",
        "output": "OUTP?",
        "reading_s": 0.5,
        "channels": {str(101 + k): "volts" for k in range(count)},
    }
    wanted = {"unit": unit} if "unit" in fields and _accepts(fields["unit"], unit) else {}
    return wanted | {key: every[key] for key in asked(name) if key in every and _accepts(fields[key], every[key])}


def asked(name: str) -> list[str]:
    """Options that have to be asked for."""
    cls = driver(name)
    if by_hand(name):
        return []
    own, fields = {one.option for one in cls.contracts}, cls.Options.model_fields
    needed = any(field.is_required() for key, field in fields.items() if key not in own)
    also = _ASKED if needed else ()
    return [key for key, field in fields.items() if key not in own and (field.is_required() or key in also)]


def widened(part: str, name: str, answers: Answers) -> dict[str, float]:
    """Limits of an instrument's options that are moved outward, so that it takes all levels."""
    cls, values = driver(name), answers.get(_LEVELS.get(part, ""), [])
    found = opened(name, {})
    if not values or found is None or not hasattr(found, "limits"):
        return {}
    low, high = found.limits()
    ends = {"low": min(values) if min(values) < low else None, "high": max(values) if max(values) > high else None}
    keys = {key.partition("_")[0]: key for key in cls.Options.model_fields if key.partition("_")[0] in ends}
    wider = {keys[end]: value for end, value in ends.items() if value is not None and end in keys}
    return {key: value for key, value in wider.items() if _accepts(cls.Options.model_fields[key], value)}


def _accepts(field: Any, value: Any) -> bool:
    try:
        _adapter(field).validate_python(value)
    except ValidationError:
        return False
    return True


def _adapter(field: Any) -> TypeAdapter[Any]:
    kind: Any = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return TypeAdapter(kind)


def option_check(name: str, key: str, before: Callable[[], Mapping[str, Any]]) -> Callable[[Any], Any]:
    """A check of one option; of the last one also of all together.

    Args:
        name: the driver.
        key: the option.
        before: the other options that are known.
    """
    cls = driver(name)
    field = cls.Options.model_fields[key]

    def check(given: Any) -> Any:
        value = option(given, is_text=_accepts(field, "any text"))
        try:
            _adapter(field).validate_python(value)
        except ValidationError as error:
            raise ValueError(f"{error.errors()[0]['msg']}: {field.description}") from None
        if key == asked(name)[-1]:
            try:
                validated(cast(type[BaseModel], cls.Options), _with(name, {**before(), key: value}), name)
            except ConfigurationError as error:
                raise ValueError(str(error)) from None
        return value

    return check


def descriptions(name: str) -> Iterator[tuple[str, str]]:
    """Options that are asked for, each with its description."""
    fields = driver(name).Options.model_fields
    yield from ((key, fields[key].description or key) for key in asked(name))
