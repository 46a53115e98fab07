"""The questions of `rig new`, as data: a terminal or a form asks them through `due`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rig.drivers.errors import WrongAddress
from rig.drivers.roles import Typing
from rig.errors import UsageError
from rig.new import answers as of
from rig.new import instruments
from rig.new.answers import MODELS, NONE, Answers
from rig.new.instruments import CHAMBER, PARTS, READS, SETS, STANDARD, THERMOMETER
from rig.procedures.column_names import spelled, split_unit, stem_of, unit_of
from rig.procedures.present.meant import nearest
from rig.procedures.tables.table import UNITS
from rig.units.of_instruments import TEMPERATURE_UNIT


def _always(_: Answers) -> bool:
    return True


def _no_choices(_: Answers) -> Mapping[str, str]:
    return {}


@dataclass(frozen=True)
class Question:
    """One question.

    Attributes:
        key: of its answer, in a file of answers.
        ask: the question.
        why: its explanation, a line.
        default: an answer by the earlier ones.
        check: the answer, from what was given; raises `ValueError` with what is wrong and what is possible.
        choices: names that can be chosen, each with what it is; none for a free answer.
        when: whether it is asked, by the earlier answers.
        port: whether it asks where an instrument is connected.
    """

    key: str
    ask: str
    why: str
    default: Callable[[Answers], Any]
    check: Callable[[Any, Answers], Any]
    choices: Callable[[Answers], Mapping[str, str]] = _no_choices
    when: Callable[[Answers], bool] = _always
    port: bool = False


_USUAL = {"pressure": "bar", "temperature": TEMPERATURE_UNIT, "voltage": "V", "current": "A", "flow": "L_per_min"}
_USUAL |= {"force": "kN", "mass": "kg", "length": "mm", "torque": "Nm", "angle": "deg", "humidity": "pct"}
ORDERS = {
    "up-down": "from the lowest level to the highest and back: shows hysteresis",
    "random": "protects best against drift",
    "as written": "in the order of the levels",
}


def has_chamber(answers: Answers) -> bool:
    """Whether temperatures are set beside what is calibrated."""
    return bool(answers.get(CHAMBER, NONE) != NONE)


def has_thermometer(answers: Answers) -> bool:
    """Whether another thermometer than the chamber's own reads its temperature."""
    return bool(answers.get(with_key(THERMOMETER), NONE) != NONE)


def soaked(answers: Answers) -> bool:
    """Whether what is set is itself a temperature, which an instrument brings about."""
    return bool(answers["sets_in"] == TEMPERATURE_UNIT) and not instruments.by_hand(answers["sets_with"])


def factor(answers: Answers) -> str:
    """The column of what is set."""
    return f"{answers['quantity']}_{answers['sets_in']}"


def factors(answers: Answers) -> dict[str, list[float]]:
    """Levels of all that is set, by column."""
    found = {factor(answers): answers["levels"]}
    return found | ({"chamber_degC": answers["chamber_degC"]} if has_chamber(answers) else {})


def has_standard(answers: Answers) -> bool:
    """Whether a standard reads what is set."""
    return bool(answers.get(STANDARD, NONE) != NONE)


def steers(answers: Answers) -> bool:
    """Whether a standard reads another quantity than the one that is set: a flow, for the volts of a valve."""
    return has_standard(answers) and answers[STANDARD] != factor(answers)


def abscissa(answers: Answers) -> str:
    """The column of models and results: what a standard reads, or what is set."""
    return str(answers[STANDARD]) if has_standard(answers) else factor(answers)


def ends(answers: Answers) -> list[float]:
    """Lowest and highest value of the abscissa."""
    found = answers["standard_range"] if steers(answers) else answers["levels"]
    return [min(found), max(found)]


def modelled(answers: Answers) -> dict[str, list[float]]:
    """Levels of all that a model may have, by column."""
    found = factors(answers)
    return {abscissa(answers): found.pop(factor(answers)), **found}


def with_key(part: str) -> str:
    """The key of the instrument of a part."""
    return CHAMBER if part == CHAMBER else f"{part}_with"


def _quantity(given: Any, _: Answers) -> str:
    found = of.word(given)
    if found in (CHAMBER, "replicate", "order", "elapsed", "block"):
        raise ValueError(f"{found} is a name with a meaning of its own here; choose another, such as line_{found}")
    return found


def _standard(given: Any, answers: Answers) -> str:
    found = str(given).strip()
    if found == NONE:
        return NONE
    stem, unit = split_unit(of.word(found))
    if not (stem and unit) or stem in (CHAMBER, "replicate", "order", "elapsed", "block"):
        raise ValueError(f"{found} has to be a name with its unit, such as flow_kg_per_min, or {NONE}")
    if stem == answers["quantity"] and found != factor(answers):
        raise ValueError(f"it is read as {factor(answers)}, in the unit in which it is set, or has another name")
    return found


def _range(given: Any, _: Answers) -> list[float]:
    found = of.levels(given)
    return [min(found), max(found)]


_FULL = {"A": 0.02, "Hz": 1000.0, "ohm": 100.0}
"""Outputs that are proposed for the largest value, by unit; 1 in others."""
_MILLI = 20.0  # of strain gauges, or of a current loop


def _usually_read(answers: Answers) -> list[float]:
    """An output at both ends, as its unit suggests: the value itself if it is in its unit."""
    both, unit = ends(answers), answers["reads_in"]
    full = _MILLI if unit[:1] == "m" and unit[1:] in ("V", "A") else _FULL.get(unit, 1.0)
    if unit == unit_of(abscissa(answers)):
        return both
    top = max(map(abs, both))
    rounded = ([float(f"{full * one / top:.{digits}g}") for one in both] for digits in range(1, 16))
    return next((found for found in rounded if found[0] != found[1]), both)


def _sensor(given: Any, answers: Answers) -> str:
    found = of.word(given)
    if found in (answers["quantity"], stem_of(abscissa(answers)), *UNITS):
        raise ValueError(f"{found} is a column of the table already; choose another, such as {found}_sensor")
    return found


def _with(part: str) -> Callable[[Answers], str]:
    def default(answers: Answers) -> str:
        there = list(instruments.offered(part, answers))
        people = [name for name in there if name != NONE and instruments.by_hand(name)]
        if part in (CHAMBER, THERMOMETER):
            return NONE
        if part == SETS:
            return (people or there)[0]
        return min(there, key=lambda one: (instruments.driver(one).wire != "serial", bool(instruments.asked(one))))

    return default


def _wired(part: str) -> Callable[[Answers], bool]:
    def wired(answers: Answers) -> bool:
        name = answers.get(with_key(part), NONE)
        return name != NONE and bool(instruments.driver(name).wire != "none")

    return wired


_PLACES = {"serial": "/dev/rig/{}", "modbus": "modbus-tcp://192.0.2.10:502/1", "can": "can:socketcan/can0"}


_WHERE = "such as /dev/ttyUSB0, COM4, socket://HOST:5025, modbus-tcp://HOST:502/UNIT, visa://GPIB0::9::INSTR"


def _address(part: str, number: int = 1) -> Question:
    def check(given: Any, answers: Answers) -> str:
        from rig.drivers.wires.addresses import parse_address  # noqa: PLC0415 - imports the wires

        found, cls = of.text(given), instruments.driver(answers[with_key(part)])
        try:
            address = parse_address(found, cls.wire)
        except WrongAddress as error:
            raise ValueError(str(error)) from None
        if address.simulated:
            raise ValueError(f"{found} belongs to a twin; write the instrument's own address, `--dry` replaces it")
        for other in PARTS[: PARTS.index(part) + 1]:
            places = [answers.get(at_key(other, n)) for n in range(1, number if other == part else 2)]
            if found in places and not getattr(cls, "shares", False):
                raise ValueError(f"{found} is the address of {answers[with_key(other)]}; each instrument has its own")
        return found

    def default(answers: Answers) -> str:
        named = part if number == 1 else f"{part}_{number}"
        return _PLACES[instruments.driver(answers[with_key(part)]).wire].format(named)

    which = "it" if number == 1 else f"number {number} of them"
    return Question(
        at_key(part, number), f"Where is {which} connected?", _WHERE,
        default, check, when=_wired(part), port=True,
    )  # fmt: skip


def at_key(part: str, number: int = 1) -> str:
    """The key of the address of a part's instrument, or of another one like it."""
    return f"{part}_at" if number == 1 else f"{part}_at_{number}"


def _channels(given: Any, answers: Answers) -> int:
    found, name = of.whole(given, 1, 60), answers["reads_with"]
    if instruments.by_hand(name):
        return found
    options = instruments.suggested(READS, name, {**answers, "channels": found})
    there = instruments.channels(name, options, answers["reads_in"])
    if there is not None and 1 != len(there) < found:
        raise ValueError(
            f"{name} has {len(there)} of {spelled(answers['reads_in'])} ({', '.join(there)}); choose fewer, "
            "another instrument, or write the file of yours (docs/how_to/own_instrument.md)"
        )
    return found


QUESTIONS: tuple[Question, ...] = (
    Question("name", "What is the bench called?", "a name for people", lambda _: "my bench", lambda v, _: of.text(v)),
    Question(
        "quantity", "What do you set?", "one word, such as force, pressure, temperature, voltage",
        lambda _: "force", _quantity,
    ),
    Question(
        "sets_in", "In which unit?", "such as kN, bar, degC, V, m3/h",
        lambda a: _USUAL.get(a["quantity"], "V"), lambda v, _: of.unit(v),
    ),
    Question(
        "levels", "At which levels?", "a list, 0 2 4 10, or first, last and number: 0 to 10 in 6",
        lambda _: [0.0, 2.0, 4.0, 6.0, 8.0, 10.0], lambda v, _: of.levels(v),
    ),
    Question(
        "sets_with", "With which instrument is it set?", "its name, or your own file ./NAME.toml",
        _with(SETS), lambda v, a: instruments.named(SETS, v, a), lambda a: instruments.offered(SETS, a),
    ),
    _address(SETS),
    Question(
        STANDARD, "Does a standard read what you set?",
        "what it reads, with its unit, such as flow_kg_per_min: models and certificates are in it; or none",
        lambda _: NONE, _standard,
    ),
    Question(
        "standard_with", "With which instrument does it read?", "its name, or your own file ./NAME.toml",
        _with(STANDARD), lambda v, a: instruments.named(STANDARD, v, a), lambda a: instruments.offered(STANDARD, a),
        when=has_standard,
    ),
    _address(STANDARD),
    Question(
        "standard_range", "What does it read at the lowest and the highest level?",
        "about, such as 0.5 4: points of the certificate, and the simulated bench",
        lambda a: [min(a["levels"]), max(a["levels"])], _range, when=steers,
    ),
    Question(
        "reads", "What do you calibrate?", "a name for what you read, such as cell or gauge; several are numbered",
        lambda _: "sensor", _sensor,
    ),
    Question(
        "reads_in", "In which unit is it read?", "the unit of its output, such as V, Hz, bar",
        lambda _: "V", lambda v, _: of.unit(v),
    ),
    Question(
        "reads_range", "What does it read at the lowest and the highest level?",
        "about, the lowest level first: only the simulated bench needs it; proposed are round numbers",
        _usually_read, lambda v, _: of.two(v),
    ),
    Question(
        "reads_with", "With which instrument is it read?", "its name, or your own file ./NAME.toml",
        _with(READS), lambda v, a: instruments.named(READS, v, a), lambda a: instruments.offered(READS, a),
    ),
    Question(
        "channels", "How many are read?", "each is a channel of it; of a meter with one channel there is one for each",
        lambda _: 1, _channels,
    ),
    _address(READS),
    Question(
        "resolution", "How finely can it be read?", "in its unit: the smallest difference that the eye sees",
        lambda _: 0.01, lambda v, _: of.number(v, 1e-12, 1e12),
        when=lambda a: instruments.plays(a["reads_with"], Typing) and instruments.by_hand(a["reads_with"]),
    ),
    Question(
        CHAMBER, "In a chamber or bath?", "temperatures are whole plots: each is set, soaked and kept for all levels",
        _with(CHAMBER), lambda v, a: v if v == NONE else instruments.named(CHAMBER, v, a),
        lambda a: instruments.offered(CHAMBER, a), when=lambda a: a["sets_in"] != TEMPERATURE_UNIT,
    ),
    Question(
        "chamber_degC", "At which temperatures?", "in degC: a list, 10 25 40, or 10 to 40 in 3",
        lambda _: [10.0, 25.0, 40.0], lambda v, a: _in_reach(of.levels(v), a), when=has_chamber,
    ),
    _address(CHAMBER),
    Question(
        with_key(THERMOMETER), "Which other thermometer reads that temperature?",
        "its name, or your own file ./NAME.toml",
        _with(THERMOMETER), lambda v, a: v if v == NONE else instruments.named(THERMOMETER, v, a),
        lambda a: instruments.offered(THERMOMETER, a), when=has_chamber,
    ),
    _address(THERMOMETER),
    Question(
        "soak_min", "How many minutes at temperature before it is read?", "after chamber and thermometers have arrived",
        lambda a: 60.0 if has_chamber(a) else 20.0, lambda v, _: of.number(v, 0, 10_000),
        when=lambda a: has_chamber(a) or soaked(a),
    ),
    Question(
        "order", "In which order?", "of the levels",
        lambda _: "up-down", lambda v, _: of.chosen(v, ORDERS), lambda _: ORDERS,
    ),
    Question(
        "replications", "How many replications?", "all levels are measured this often: 3 show what repeats",
        lambda _: 3, lambda v, _: of.whole(v, 1, 1000),
    ),
    Question(
        "dwell_s", "How many seconds does a level stand before it is read?", "until what you read has settled",
        lambda _: 10.0, lambda v, _: of.number(v, 0, 1e6),
    ),
    Question(
        "model", "Which model?", "a name, or a formula such as 1 + force_kN + force_kN^2",
        lambda _: of.UNKNOWN, lambda v, a: of.model(v, modelled(a)), lambda _: MODELS,
    ),
)  # fmt: skip
"""All questions in their order; options of instruments follow their addresses, see `due`."""


def _in_reach(found: list[float], answers: Answers) -> list[float]:
    if why := instruments.unsuitable(CHAMBER, answers[CHAMBER], {**answers, "chamber_degC": found}):
        raise ValueError(why)
    return found


def due(answers: Answers) -> Iterator[Question]:
    """The questions in order; `answers` grows while they are asked, and decides which come."""
    for question in QUESTIONS:
        if question.when(answers):
            yield question
        part = question.key.removesuffix("_at")
        if question.port and answers.get(with_key(part), NONE) != NONE:
            several = range(2, instruments.meters(answers) + 1) if part == READS else ()
            yield from (_address(part, number) for number in several)
            yield from _options(part, answers[with_key(part)])


def _options(part: str, name: str) -> Iterator[Question]:
    def question(key: str, words: str) -> Question:
        return Question(
            f"{part}_options.{key}", f"Option {key} of {name}?", words,
            lambda a: instruments.suggested(part, name, a).get(key, ""),
            lambda v, a: instruments.option_check(name, key, lambda: known_options(part, a))(v),
        )  # fmt: skip

    yield from (question(key, words) for key, words in instruments.descriptions(name))


def known_options(part: str, answers: Answers) -> dict[str, Any]:
    """Options of a part's instrument: that follow from other answers, and answered ones."""
    name, begin = answers[with_key(part)], f"{part}_options."
    own = {key.removeprefix(begin): value for key, value in answers.items() if key.startswith(begin)}
    fixed = {k: v for k, v in instruments.suggested(part, name, answers).items() if k not in instruments.asked(name)}
    return {**fixed, **instruments.widened(part, name, answers), **own}


def completed(given: Mapping[str, Any], where: str) -> Answers:
    """Answers from a file, checked, with defaults for missing ones. Raises `UsageError`."""
    flat: dict[str, Any] = {}
    for key, value in given.items():
        nested = key.endswith("_options") and isinstance(value, Mapping)
        flat |= {f"{key}.{inner}": one for inner, one in value.items()} if nested else {key: value}
    answers: Answers = {}
    for question in due(answers):
        value = flat.pop(question.key, None)
        try:
            answers[question.key] = question.check(question.default(answers) if value is None else value, answers)
        except ValueError as error:
            raise UsageError(f"{where}: {question.key}: {error}") from None
    for key in flat:
        near = nearest(key, answers)
        hint = f"did you mean {near}?" if near else f"asked are {', '.join(answers)}"
        raise UsageError(f"{where}: {key} is not asked with these answers; {hint}")
    return answers
