"""Bench, procedure, register and world of answers, as texts with comments; and their writing, all or none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import Any

from rig.bench.plugins import is_file
from rig.drivers.roles import ByHand, Head, PressureController
from rig.errors import UsageError
from rig.files.atomic import check_writable
from rig.files.toml_text import toml_text
from rig.new import instruments
from rig.new.answers import NONE, UNKNOWN, Answers, formula
from rig.new.instruments import CHAMBER, PARTS, READS, SETS, STANDARD, THERMOMETER, meters
from rig.new.questions import (
    abscissa,
    at_key,
    ends,
    factor,
    factors,
    has_chamber,
    has_standard,
    has_thermometer,
    known_options,
    modelled,
    soaked,
    steers,
    with_key,
)
from rig.procedures.column_names import spelled, unit_of
from rig.units.of_instruments import ATMOSPHERE_PSIA, TEMPERATURE_UNIT
from rig.verbs.instrument.catalogue import text_named

NAMES = ("bench.toml", "procedure.toml", "equipment.toml", "certificate.toml", "world.toml", "answers.toml")
"""Files that are written."""
BENCH, PROCEDURE, REGISTER, CERTIFICATE, WORLD, ANSWERS = NAMES
_NAMES = {SETS: "source", STANDARD: "standard", READS: "meter", CHAMBER: "chamber", THERMOMETER: "thermometer"}
_ASSETS = {
    SETS: "SET-{:02d}",
    STANDARD: "REF-{:02d}",
    READS: "READ-{:02d}",
    CHAMBER: "CH-{:02d}",
    THERMOMETER: "TH-{:02d}",
}
_SOAKED_BY, _ROOM = 15.0, (0.0, 30.0)
_READINGS = 5


def texts(answers: Answers) -> dict[str, str]:
    """The texts of all files, by name; files of the person's own instruments with them."""
    own = {
        Path(answers[with_key(part)]).name: text_named(str(Path(answers[with_key(part)]).expanduser()))[0]
        for part in _parts(answers)
        if is_file(answers[with_key(part)])
    }
    made = {BENCH: _bench, PROCEDURE: _procedure, REGISTER: _register, CERTIFICATE: _certificate, WORLD: _world}
    files = {key: f"./{Path(value).name}" for key, value in answers.items() if _own_file(key, value)}
    kept = f"# The answers to the questions. With --answers {ANSWERS}, rig new makes the same files of them.\n"
    return {
        **{name: "\n".join(lines(answers)) + "\n" for name, lines in made.items()},
        ANSWERS: kept + toml_text(_nested({**answers, **files})),
        **own,
    }


def _own_file(key: str, value: Any) -> bool:
    return key in map(with_key, PARTS) and is_file(value)


def beside(given: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Given answers, with files of instruments beside their own file found from here."""
    return {key: str(folder / value) if _own_file(key, str(value)) else value for key, value in given.items()}


def refuse_existing(folder: Path, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Refuse to overwrite. Raises `UsageError`."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; name a folder")
    if there := [name for name in names if (folder / name).exists() or (folder / name).is_symlink()]:
        raise UsageError(f"{folder} has {', '.join(there)} already, which is not overwritten; name another folder")


def write(folder: Path, files: Mapping[str, str]) -> None:
    """Write all files into a folder, or none of them. Raises `UsageError`."""
    refuse_existing(folder, files)
    made, fresh = [], not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            with check_writable(folder / name).open("x", encoding="utf-8") as file:
                made.append(folder / name)
                file.write(text)
    except BaseException as error:
        for path in made:
            path.unlink(missing_ok=True)
        if fresh and folder.is_dir():
            folder.rmdir()
        if isinstance(error, OSError):
            raise UsageError(f"{folder} cannot be written: {error.strerror}; nothing was written") from error
        raise


def _nested(answers: Answers) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in answers.items():
        part, _, option = key.partition(".")
        if option:
            found.setdefault(part, {})[option] = value
        else:
            found[key] = value
    return found


def _parts(answers: Answers) -> list[str]:
    return [part for part in PARTS if answers.get(with_key(part), NONE) != NONE]


def _person(answers: Answers, part: str) -> bool:
    return instruments.by_hand(answers[with_key(part)])


def _instrument(answers: Answers, part: str, number: int = 1) -> str:
    """Its name on the bench; a person is one, whatever he does."""
    numbered = f"_{number}" if part == READS and meters(answers) > 1 else ""
    return "operator" if _person(answers, part) else f"{_NAMES[part]}{numbered}"


def _numbers(answers: Answers, part: str) -> range:
    """Numbers of the instruments of a part, from 1."""
    return range(1, 1 + (meters(answers) if part == READS else 1))


def _asset(part: str, number: int = 1) -> str:
    return _ASSETS[part].format(number)


def _dials(answers: Answers) -> list[str]:
    return ["dial"] if answers["channels"] == 1 else [f"dial_{k + 1}" for k in range(answers["channels"])]


def _sensors(answers: Answers) -> list[str]:
    count = answers["channels"]
    return [answers["reads"]] if count == 1 else [f"{answers['reads']}_{k + 1}" for k in range(count)]


def _line(key: str, value: Any, comment: str = "") -> str:
    line = toml_text({key: value}).strip()
    if isinstance(value, Mapping):
        inner = ", ".join(toml_text({one: v}).strip() for one, v in value.items())
        line = f"{key} = {{ {inner} }}"
    return _beside(line, comment) if comment else line


def _beside(line: str, comment: str, column: int = 37) -> str:
    return f"{line:<{column}} # {comment}"


def _bench(answers: Answers) -> Iterator[str]:
    yield "# The bench: instruments, sensors on it, and limits. `rig run --dry` puts a simulated twin in place of each."
    yield "# `rig explain bench` explains every key, `rig explain instruments DRIVER` the options of one instrument."
    yield _line("name", answers["name"])
    yield _line("equipment", REGISTER, "the register: what certificates of instruments say")
    told: list[str] = []
    for part in _parts(answers):
        for number in _numbers(answers, part):
            if _instrument(answers, part, number) not in told:
                told.append(_instrument(answers, part, number))
                yield from _instrument_lines(answers, part, number)
    yield from _sensor_lines(answers)
    yield from ["", "[factors]                             # which instrument sets each factor of the procedure"]
    if not instruments.plays(answers["sets_with"], Head):
        yield _line(factor(answers), _instrument(answers, SETS))
    if has_chamber(answers):
        yield _line("chamber_degC", _instrument(answers, CHAMBER))
    if has_standard(answers):
        yield from ["", _beside(f"[references.{abscissa(answers)}]", "models and results are in what it reads")]
        yield _line("reader", _instrument(answers, STANDARD))
        yield from [_line("of", factor(answers), "what is set to make it")] if steers(answers) else []
    if has_thermometer(answers):
        yield from ["", _beside("[references.chamber_degC]", "beside the chamber's own reading")]
        yield _line("reader", _instrument(answers, THERMOMETER))
    yield from [
        "",
        "# Lowest and highest value, of commands and of what is read back, also at rest. Set them to what your",
    ]
    yield "# bench and sensors stand: they are checked before anything moves, and all the time."
    yield "[limits]"
    yield from (_line(name, ends) for name, ends in limits(answers).items())


def _instrument_lines(answers: Answers, part: str, number: int) -> Iterator[str]:
    name = answers[with_key(part)]
    does = {SETS: f"sets {factor(answers)}", READS: f"reads {answers['reads']}", CHAMBER: "sets the temperature"}
    does[THERMOMETER] = "beside what you calibrate"
    does[STANDARD] = f"the standard: it reads {abscissa(answers)}"
    yield from ["", _beside(f"[instruments.{_instrument(answers, part, number)}]", f"{does[part]}")]
    yield _line("driver", f"./{Path(name).name}" if is_file(name) else name)
    if _person(answers, part):
        if part == SETS:
            yield _line("asset", _asset(part), f"of what is set: weights, a scale; its entry in {REGISTER}")
            yield _line("say", f"set {answers['quantity']} to {{value}} {spelled(answers['sets_in'])}",
                        "what the person is asked to do")  # fmt: skip
        if _person(answers, READS):
            yield _line("reads", dict.fromkeys(_dials(answers), answers["reads_in"]), "what is typed, and its unit")
            yield _line("resolution", dict.fromkeys(_dials(answers), answers["resolution"]), "how finely it is read")
        return
    if address := answers.get(at_key(part, number)):
        yield _line("address", address, "where it is connected")
    yield _line("asset", _asset(part, number), f"your number for it, and its entry in {REGISTER}")
    options = known_options(part, answers)
    yield from (_line(key, value) for key, value in options.items())
    if number == 1:
        for key, value, words, used in instruments.more(part, name, answers):
            yield _line(key, value, words) if used else _beside(f"# {_line(key, value)}", words)


def _sensor_lines(answers: Answers) -> Iterator[str]:
    name, unit, options = answers["reads_with"], answers["reads_in"], known_options(READS, answers)
    there = _dials(answers) if _person(answers, READS) else instruments.channels(name, options, unit) or ["input"]
    several = meters(answers)
    every = there * several if several > 1 else there
    for number, (sensor, channel) in enumerate(zip(_sensors(answers), every, strict=False), 1):
        yield from ["", _beside(f"[sensors.{sensor}]", f"recorded as {sensor}_{unit}")]
        yield _line("reader", _instrument(answers, READS, number if several > 1 else 1))
        yield _line("channel", channel)
        yield _line("unit", unit)


def limits(answers: Answers) -> dict[str, list[float]]:
    """Limits of all that is set, proposed by the levels."""
    return {n: _limits(answers, part, n) for part, n in zip((SETS, CHAMBER), factors(answers), strict=False)}


def _limits(answers: Answers, part: str, name: str) -> list[float]:
    """Levels, with what an approach goes beyond, and the value at rest."""
    levels, driver = sorted(factors(answers)[name]), answers[with_key(part)]
    if instruments.plays(driver, ByHand):
        beyond, rest = 0.0, (levels[0], levels[-1])
    elif unit_of(name) == TEMPERATURE_UNIT:
        beyond, rest = _SOAKED_BY, _ROOM
    elif instruments.plays(driver, Head):
        beyond, rest = 0.0, instruments.opened(driver, known_options(part, answers)).axes()[answers["quantity"]]
    else:
        beyond = max(b - a for a, b in pairwise(levels))
        pressed = instruments.plays(driver, PressureController)
        rest = (0.0, 1.1 * ATMOSPHERE_PSIA if pressed else 0.0)
    ends = min(levels[0] - beyond, *rest), max(levels[-1] + beyond, *rest)
    own = instruments.opened(driver, known_options(part, answers))
    if own is not None and hasattr(own, "limits"):  # what the instrument refuses is no approach to a level
        low, high = own.limits()
        ends = min(max(ends[0], low), levels[0]), max(min(ends[1], high), levels[-1])
    return [float(f"{one:.6g}") for one in ends]


def _procedure(answers: Answers) -> Iterator[str]:
    name, warm = factor(answers), soaked(answers)
    yield "# The procedure: what is set, in which order, how it is read, and the model. `rig plan` forecasts it;"
    yield "# `rig explain procedure general` explains every key."
    yield 'kind = "general"'
    yield _line("name", f"{answers['reads']} over {answers['quantity']}"[:60])
    yield _line("seed", 1, "another number is another random order")
    yield _line("replications", answers["replications"], "passes over all levels: 3 show what repeats")
    if has_chamber(answers):
        yield from ["", "[factors.chamber_degC]                # the unit is the end of the name"]
        yield _line("levels", answers["chamber_degC"])
        yield _line("hard", True, "hard to change: a whole plot, soaked, kept for all levels")
        yield _line("order", "random")
    yield from ["", _beside(f"[factors.{name}]", "the unit is the end of the name")]
    yield _line("levels", answers["levels"])
    yield _line("order", answers["order"], '"random", "up-down" or "as written"')
    if warm:
        yield _line("hard", True, "a temperature is set anew and soaked for every reading")
    if has_chamber(answers) or warm:
        yield from ["", "[soak]"]
        yield _line("tolerance_degC", 0.5, "the chamber within this of its setting,")
        yield _line("dwell_s", 60.0 * answers["soak_min"], "for this long, before anything is read")
        yield _line("drift_degC_per_h", 2.0, "and drifting more slowly than this")
    yield from ["", "[settle]"]
    yield _line("dwell_s", answers["dwell_s"], "a level stands for this long before it is read")
    yield from ["", "[measure]"]
    yield _line("readings", _READINGS, "their mean is the observation")
    yield from ["", "[model]"]
    if answers["model"] == UNKNOWN:
        yield "# No model was named: this is the straight line. `rig trace RUN` says what it lacks; write that here."
    inferred = abscissa(answers)
    yield _line("formula", formula(answers["model"], inferred), "terms, each with a coefficient that is fitted")
    if has_chamber(answers):
        yield _line("abscissa", inferred, "what is inferred from a reading")
    unit = spelled(answers["reads_in"])
    scatter = float(f"{_noise(answers) / sqrt(_READINGS * (_reading_s(answers) or 1.0)):.2g}")
    sigma = ", ".join(f"{one} = {scatter:g}" for one in _sensors(answers))
    yield from [
        "",
        f"# [expect]                            # for `rig plan` alone: the scatter of one observation, in {unit};",
        _beside(f"# sigma = {{ {sigma} }}", f"here as in {WORLD}, of {_READINGS} readings"),
    ]


def _register(answers: Answers) -> Iterator[str]:
    yield "# The register: what the certificates of your equipment say. Uncertainties and certificates come from it."
    yield "# Fill in what is empty; take the # away, write your certificate's numbers. Keys: `rig explain equipment`."
    yield _line("name", f"equipment of {answers['name']}"[:60])
    yield from ["", "[laboratory]", _line("name", "", "your laboratory"), _line("address", "")]
    quantity = {SETS: factor(answers), READS: answers["reads_in"], CHAMBER: "chamber_degC", STANDARD: abscissa(answers)}
    quantity[THERMOMETER] = "chamber_degC"
    for part, number in [(one, number) for one in _parts(answers) for number in _numbers(answers, one)]:
        if part == READS and _person(answers, part):
            continue
        asset, unit = _asset(part, number), unit_of(quantity[part])
        yield from ["", f"[equipment.{asset}]"]
        yield _line("description", "set by hand" if _person(answers, part) else _NAMES[part])
        named = instruments.make(answers[with_key(part)], known_options(part, answers))
        yield from (_line(key, value) for key, value in zip(("maker", "model", "serial"), (*named, ""), strict=True))
        if (part == SETS and has_standard(answers)) or (part == CHAMBER and has_thermometer(answers)):
            by = "standard" if part == SETS else "thermometer"
            yield f"# It needs no certificate: the {by} reads what it makes."
        else:
            yield from (f"# {line}" for line in _statement(asset, quantity[part], unit))
    for sensor in _sensors(answers):
        yield from ["", _beside(f"[sensors.{sensor}]", "what you calibrate, for its certificate")]
        yield from (_line(key, "") for key in ("maker", "model", "serial", "customer", "customer_address", "condition"))


def _statement(asset: str, quantity: str, unit: str) -> Iterator[str]:
    yield f"[equipment.{asset}.certificate]"
    yield 'number = "NUMBER"'
    yield 'laboratory = "WHO CALIBRATED IT"'
    yield "date = 2026-01-31"
    yield _beside("due = 2027-01-31", "`rig plan` warns before it", 35)
    yield _beside(f"[[equipment.{asset}.says]]", "one for each error that the certificate states", 35)
    yield f'quantity = "{quantity}"'
    yield _beside('behaves = "offset"', "the same throughout; or gain, setting, reading", 35)
    yield f'unit = "{unit}"'
    yield "expanded = 0.01"
    yield "k = 2"
    yield "probability = 0.95"


def _certificate(answers: Answers) -> Iterator[str]:
    yield "# What your certificates say beside the results. Fill in what is empty. Keys: `rig explain certificate`."
    yield _line("number", "CAL-{year}-{next:04d}", "the next number that no certificate has")
    yield _line("country", "", "of your laboratory, two letters: GB")
    yield _line("item", "", "what you calibrate, in words: load cell, 10 kN")
    yield _line("approved_by", "", "who approves; --approved-by says another one")
    yield from ["at = [                                # settings at which outputs are stated", *_points(answers), "]"]
    yield from ["", "[method]", _line("name", "", "your procedure, by number and title")]


def _points(answers: Answers) -> Iterator[str]:
    """Lines of the lowest, a middle, and the highest level, with a middle of what else is set."""
    name, levels = abscissa(answers), sorted(answers["levels"])
    more = {n: sorted(v)[len(v) // 2] for n, v in modelled(answers).items() if n != name}
    low, high = ends(answers)
    middle = float(f"{0.5 * (low + high):.3g}") if steers(answers) else levels[len(levels) // 2]
    for level in dict.fromkeys((low, middle, high)):
        yield f"    {{ {', '.join(toml_text({n: v}).strip() for n, v in {name: level, **more}.items())} }},"


def _world(answers: Answers) -> Iterator[str]:
    name, (low, high) = abscissa(answers), ends(answers)
    bottom, top = answers["reads_range"]
    slope = (top - bottom) / (high - low)
    offset = float(f"{bottom - slope * low:.4g}")
    yield "# The truth behind a dry run: `rig run ... --dry --world world.toml`. Fit and trace never read it."
    yield "# Give it a `hidden` part to see whether the trace finds it: `rig explain world`."
    yield _line("seed", 1)
    if has_standard(answers):
        levels = sorted(answers["levels"])
        gain = float(f"{(high - low) / (levels[-1] - levels[0]):.6g}")
        yield from ["", _beside(f"[references.{name}]", "the true value, as a function of what is set")]
        shift = f"{low:g} + {gain:g}*({factor(answers)} - {levels[0]:g})".replace("- -", "+ ")
        yield from [_line("formula", shift)] if steers(answers) else []
        yield _line("noise", float(f"{1e-5 * max(abs(low), abs(high)):.1g}"))
    if has_thermometer(answers):
        yield from ["", "[references.chamber_degC]", _line("noise", 0.002)]
    for sensor in _sensors(answers):
        yield from ["", _beside(f"[sensors.{sensor}]", f"in {spelled(answers['reads_in'])}")]
        yield _line("formula", f"{offset:g} + {slope:.4g}*{name}".replace("+ -", "- "))
        yield _line("noise", _noise(answers), "standard deviation of a mean over 1 s")
        if has_chamber(answers) and sensor == _sensors(answers)[0]:
            yield _beside(
                f'# hidden = "{0.001 * slope:.1g}*{name}*(chamber_degC - 25)"', "what your model does not have"
            )


def _reading_s(answers: Answers) -> float:
    """Seconds that one reading of a sensor takes; 0 if neither the answers nor the instrument's file say it."""
    options = known_options(READS, answers)
    return float(options.get("reading_s") or instruments.reading_s(answers[with_key(READS)]))


def _noise(answers: Answers) -> float:
    """Scatter of a simulated reading: a ten-thousandth of the range, or half of what an eye can tell."""
    bottom, top = answers["reads_range"]
    return float(f"{max(1e-4 * abs(top - bottom), 0.5 * answers.get('resolution', 0.0)):.1g}")
