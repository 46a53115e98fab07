"""CAN messages of an instrument's file: its DBC, how the file names signals and messages, and whether both fit.

A question is a signal, `Readings.Temperature`. A command is a message, `Command: Setpoint = 25, Enable = 1`; signals
that it does not name keep what was sent last.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache

from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.frames import EXTENDED, shown_id
from rig.contracts.declared.units import same_unit

Place = tuple[Message, Signal]
"""Place of a number: message and signal."""
REMOTELY = "remote"
"""A request that is a remote frame of the message."""
SWITCHED = frozenset({"0", "1", "ON", "OFF"})
"""Words that need no meaning where something is on or off, or has arrived or not."""

_LINE = re.compile(r" *([A-Za-z_]\w*) *(?:: *(.*?))? *")
_SIGNAL = re.compile(r" *([A-Za-z_]\w*) *= *(.*?) *")
_PATH = re.compile(r" *([A-Za-z_]\w*\.[A-Za-z_]\w*) *= *(.*?) *")
_LONGEST = 8


@lru_cache(maxsize=16)  # a bench is checked and opened with the same text, and parsing takes 20 ms
def read_dbc(text: str) -> Database:
    """The messages of a DBC file. Raises `ValueError` if it cannot be read."""
    try:
        database = load_string(text, "dbc")
    except (Error, ValueError) as error:
        raise ValueError(f"the DBC cannot be read: {error}") from error
    if not isinstance(database, Database) or not database.messages:
        raise ValueError("the DBC describes no messages")
    return database


def find_signal(database: Database, label: str, path: str) -> Place:
    """The signal at MESSAGE.SIGNAL. Raises `ValueError` with the existing ones."""
    name, *_ = path.partition(".")
    places = {f"{m.name}.{s.name}": (m, s) for m in database.messages for s in m.signals}
    if path not in places:
        known = [known for known in places if known.startswith(f"{name}.")]
        known = known or get_close_matches(path, places, 4, 0.5) or list(places)
        raise ValueError(f"{label} = {path!r} is not in the DBC; it has {', '.join(known)}")
    return places[path]


def frame_name(message: Message, plus: int = 0) -> str:
    """Identifier, to which a number is added, and name of a message, as on a bus monitor."""
    return f"{shown_id(can_id(message) + plus)} ({message.name})"


def can_id(message: Message) -> int:
    """Identifier of a message's frames, with `EXTENDED` if it has 29 bits."""
    return message.frame_id | (EXTENDED if message.is_extended_frame else 0)


def command(line: str) -> tuple[str, dict[str, str]]:
    """Message and signals of a command, `Command: Setpoint = {value}, Enable = 1`. Raises `ValueError`."""
    found = _LINE.fullmatch(line)
    if found is None:
        raise ValueError(f"{line!r} should be a message with signals: `Command: Setpoint = {{value}}, Enable = 1`")
    signals = {}
    for part in filter(None, (found[2] or "").split(",")):
        one = _SIGNAL.fullmatch(part)
        if one is None or not one[2]:
            raise ValueError(f"{part.strip()!r} in {line!r} should be a signal with its value: `Enable = 1`")
        signals[one[1]] = one[2]
    return found[1], signals


def told(answer: str) -> tuple[str, str]:
    """Signal and right value of an acknowledgement, `Answer.Result = Accepted`. Raises `ValueError`."""
    found = _PATH.fullmatch(answer)
    if found is None:
        raise ValueError(f"{answer!r} should be a signal with its right value: `Answer.Result = 1`")
    return found[1], found[2]


def words_of(signal: Signal) -> dict[str, int]:
    """Numbers on the wire by word of a signal's value table."""
    return {str(word): int(number) for number, word in (signal.choices or {}).items()}


def step_of(signal: Signal) -> float:
    """Step of a signal's value; 0 of a floating-point number."""
    return 0.0 if signal.is_float else abs(float(signal.scale))


def _of_hole(tell: Tell) -> str:
    """The signal of a command that takes {value}, "" if there is none."""
    try:
        name, signals = command(tell.tell or "")
    except ValueError:
        return ""
    return next((f"{name}.{key}" for key, text in signals.items() if "{value" in text), "")


def step_of_value(database: Database, tell: Tell) -> float:
    """Step of the value that a command sets, in the unit of the file; 0 if it sets none."""
    path = _of_hole(tell)
    return abs(tell.scale) * step_of(find_signal(database, "", path)[1]) if path else 0.0


def wrong_messages(
    database: Database,
    asks: Sequence[tuple[str, Ask]],
    tells: Sequence[tuple[str, Tell]],
    units: Mapping[str, str],
    spelled: Mapping[str, str],
    common: Mapping[str, str],
) -> Iterator[str]:
    """Where a file does not fit its DBC, as sentences.

    Args:
        database: its DBC.
        asks, tells: questions and commands by place in the file.
        units: declared unit by place.
        spelled: units by the instrument's spelling.
        common: words of all answers.
    """
    for place, ask in asks:
        for key, path in (("", ask.ask), (".status", ask.status), (".serial", getattr(ask, "serial", None))):
            if path is not None:
                yield from _of_signal(database, f"{place}{key}", path)
        if ask.request not in (None, REMOTELY):
            yield from _of_command(database, f"{place}.request", ask.request or "")
        yield from _of_words(database, place, ask, common)
        if ask.scale == 1.0 and ask.offset == 0.0 and place in units:
            yield from _of_unit(database, place, ask.ask or "", units[place], spelled)
    for place, tell in tells:
        yield from _of_command(database, place, tell.tell or "")
        if place in units and tell.scale == 1.0 and tell.offset == 0.0 and (path := _of_hole(tell)):
            yield from _of_unit(database, place, path, units[place], spelled)
        for answer in tell.answer:
            try:
                path, word = told(answer)
                message, signal = find_signal(database, f"{place}.answer", path)
                yield from _of_value(f"{place}.answer", message, signal, word)
            except ValueError as error:
                yield str(error)


def _of_signal(database: Database, place: str, path: str) -> Iterator[str]:
    try:
        message, _ = find_signal(database, place, path)
    except ValueError as error:
        yield str(error)
    else:
        yield from _of_frame(place, message)


def _of_frame(place: str, message: Message) -> Iterator[str]:
    if message.length > _LONGEST or message.is_fd or message.is_container:
        yield f"{place}: {message.name} has {message.length} bytes; only classic frames of up to {_LONGEST} are known"


def _of_command(database: Database, place: str, line: str) -> Iterator[str]:
    try:
        name, given = command(line)
    except ValueError as error:
        yield f"{place}: {error}"
        return
    message = next((one for one in database.messages if one.name == name), None)
    if message is None:
        yield f"{place}: the DBC has no message {name!r}; it has {', '.join(one.name for one in database.messages)}"
        return
    yield from _of_frame(place, message)
    signals = {one.name: one for one in message.signals}
    for key, value in given.items():
        if key not in signals:
            yield f"{place}: {name} has no signal {key!r}; it has {', '.join(signals)}"
        else:
            yield from _of_value(place, message, signals[key], value)


def _of_value(place: str, message: Message, signal: Signal, text: str) -> Iterator[str]:
    """A value that a signal cannot have."""
    words = words_of(signal)
    if "{" in text or text in words:
        return
    try:
        number = float(text)
    except ValueError:
        known = f"one of its words, {', '.join(words)}, or a number" if words else "a number"
        yield f"{place}: {message.name}.{signal.name} = {text!r} should be {known}"
        return
    low, high = span(signal)
    if not low <= number <= high:
        yield f"{place}: {message.name}.{signal.name} = {number:g} is outside {low:g} to {high:g}, its range in the DBC"


def span(signal: Signal) -> tuple[float, float]:
    """Range of a signal in its unit: that of the DBC, or of its bits."""
    if signal.minimum is not None and signal.maximum is not None and signal.minimum < signal.maximum:
        return float(signal.minimum), float(signal.maximum)
    if signal.is_float:
        return -3.4e38, 3.4e38
    least, most = (-(1 << signal.length - 1), (1 << signal.length - 1) - 1) if signal.is_signed else (0, 0)
    ends = [float(raw) * signal.scale + signal.offset for raw in (least, most or (1 << signal.length) - 1)]
    return min(ends), max(ends)


def _of_words(database: Database, place: str, ask: Ask, common: Mapping[str, str]) -> Iterator[str]:
    """Words that the DBC does not have, or words of the DBC whose meaning nobody says."""
    path = ask.status or ask.ask or ""
    try:
        _, signal = find_signal(database, place, path)
    except ValueError:
        return  # said already
    has, given = words_of(signal), {**common, **ask.words}
    for word in ask.words:
        if has and word not in has and word not in SWITCHED and not re.fullmatch(r"[+-]?[0-9]+(\.[0-9]+)?", word):
            yield f"{place}.words: {path} is never {word!r}; the DBC has {', '.join(has)}"
    if ask.status is not None and not given:
        yield f"{place}: status = {path!r} needs words: which of its values means that a reading counts (stable)"
    if not (ask.status is not None or place.endswith((".output", ".settled"))) or ask.asks_bit:
        return
    own = set(given) - (SWITCHED if set(given) <= SWITCHED else set())
    for word, number in has.items():
        if word not in own and str(number) not in own and word.upper() not in {"ON", "OFF"} & set(given):
            yield f"{place}: {path} may be {word!r} ({number}) by the DBC; say in words what that means"


def _of_unit(database: Database, place: str, path: str, declared: str, spelled: Mapping[str, str]) -> Iterator[str]:
    try:
        _, signal = find_signal(database, place, path)
    except ValueError:
        return
    unit = (signal.unit or "").strip()
    if unit and not (same_unit(unit, declared) or spelled.get(unit) == declared):
        yield (
            f"{place}: {path} is in {unit!r} by the DBC, and the file says {declared}; "
            f"convert it with scale and offset, or say that it is the same: [units] {json.dumps(unit)} = ..."
        )


def wrong_examples(database: Database, examples: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Frames of a file, `181#1D0A`, that are not what the file says, `Readings.Temperature = 25.9`, as sentences."""
    for frame, said in examples:
        number, _, data = frame.partition("#")
        try:
            path, wanted = told(said)
            message, _ = find_signal(database, "examples", path)
            if int(number, 16) != message.frame_id:
                yield f"examples: {frame!r} is not {frame_name(message)}, which has {path}"
                continue
            values = message.decode(bytes.fromhex(data))
        except (ValueError, Error) as error:
            yield f"examples: {frame!r}: {error}"
            continue
        found = values.get(path.partition(".")[2])  # type: ignore[union-attr]  # no container
        if not (str(found) == wanted or (isinstance(found, int | float) and abs(found - float(wanted)) < 1e-9)):
            yield f"examples: {path} in {frame!r} is {found}, not {wanted}"
