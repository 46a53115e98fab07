"""A commented file for an instrument, from answers to questions about its manual."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from rig.contracts.declared.instrument import parse

Ask = Callable[[str, str], str]
"""Takes a question and the answer that is assumed; returns the answer."""

_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?([Ee][+-]?[0-9]+)?")
_ENDS = {"lf": r"\n", "cr": r"\r", "crlf": r"\r\n"}


def form_of(answer: str) -> str:
    """A form from an answer as the manual prints it: its first number, and the unit after it.

    Example:
        >>> form_of("S S     100.00 g")
        'S S {value} {unit}'
    """
    found = _NUMBER.search(answer)
    if found is None:
        return answer.replace("{", "{{").replace("}", "}}")
    before, after = answer[: found.start()], answer[found.end() :]
    unit = re.fullmatch(r"( *)([A-Za-z%][A-Za-z0-9%/]*)(.*)", after)
    end = f"{unit[1] and ' '}{{unit}}{unit[3]}" if unit else after
    return re.sub(" +", " ", before) + "{value}" + end


def _text(value: str) -> str:
    return f"'{value}'" if "'" not in value else '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def asked(ask: Ask) -> str:
    """The text of a new file."""
    maker, model = ask("Maker, as in its identity", "ACME"), ask("Model, as in its identity", "M1")
    about = ask("What is it", "instrument")
    wire = ask(
        "Does it take lines of text, Modbus registers, does it talk by itself, or has it CAN messages of a DBC? "
        "(text, modbus, stream, can)",
        "text",
    )
    role = ask("Does it measure or set something? (reader, source)", "reader")
    unit = ask("Unit of its quantity (degC, V, g, bar)", "degC")
    lines = [f"maker = {_text(maker)}", f"model = {_text(model)}", f"about = {_text(about)}"]
    lines += ['sources = ["manual NUMBER, chapter CHAPTER"]', 'tried = ["twin only"]', "", "[wire]"]
    lines.append(f'protocol = "{wire}"')
    if wire == "modbus":
        lines += ['type = "int16"               # or uint16, int32, uint32, float32', 'word_order = "big"', ""]
        lines += _registers(ask, role, unit)
    elif wire == "can":
        lines += [f"dbc = {_text(ask('Name of its DBC, a file beside this one', 'instrument.dbc'))}", ""]
        lines += _messages(ask, role, unit)
    else:
        end = _ENDS.get(ask("How do lines end? (lf, cr, crlf)", "crlf"), r"\r\n")
        baud = ask("Baud rate, if it has a serial line", "9600")
        lines += [f"baud = {baud}", f'send_end = "{end}"           # reply_end = ... if answers end otherwise', ""]
        lines += _lines(ask, wire, role, unit, maker, model)
    return "\n".join(lines) + "\n"


def _lines(ask: Ask, wire: str, role: str, unit: str, maker: str, model: str) -> list[str]:
    found = ["[identity]                      # asked before anything else is sent"]
    if wire == "stream":
        found += ['answer = "{text}"               # the form of its lines, so that no other is believed', ""]
        said = ask("One line that it sends, from the manual", f"23.45 {unit}")
        reading = f"reading = {{ answer = {_text(form_of(said))}{_scale(ask, said, unit)} }}"
        return [*found, "[reader]", f'unit = "{unit}"', reading]
    question = ask("Question for its identity", "*IDN?")
    said = ask("Its answer, as the manual prints it", f"{maker},{model},123456,1.0")
    form = re.sub(re.escape(maker), "{maker}", said, count=1)
    form = re.sub(re.escape(model), "{model}", form, count=1)
    form = re.sub(r",[^,{]+,[^,{]+$", ",{serial},{firmware}", form)
    found += [f"ask = {_text(question)}", f"answer = {_text(form)}", ""]
    if role == "reader":
        return [*found, *_reader(ask, unit)]
    found += [
        "[source]",
        f'unit = "{unit}"',
        f"low = {ask('Lowest setpoint', '0')}",
        f"high = {ask('Highest setpoint', '100')}",
    ]
    command = ask("Command for a setpoint of 25", "SP 25")
    found.append(f"set = {_text(re.sub(r'25([.]0*)?', '{value:.2}', command, count=1))}        # .2: two decimals")
    asked = (
        ("setpoint", "Question for the setpoint", "SP?"),
        ("read", "Question for its own reading", "PV?"),
        ("on", "Command that switches it on (empty: it is always on)", "ON"),
        ("off", "Command that switches it off (empty: none)", "OFF"),
        ("output", "Question whether it is on (empty: none)", "ON?"),
    )
    found += _of_source(ask, asked)
    return [
        *found,
        "tolerance = 0.1                 # near enough to its setpoint",
        "dwell_s = 60                    # for so long",
    ]


def _reader(ask: Ask, unit: str) -> Iterator[str]:
    """Lines of a reader that is asked, with one channel or several."""
    channels = ask("Its channels, as its commands name them, such as 101 102 103 (empty: it has one)", "").split()
    first = channels[0] if channels else ""
    yield from ["[reader]", f'unit = "{unit}"']
    select = question = ""
    if channels:
        select = ask(f"Command that chooses channel {first} (empty: the question for a reading names it)", "")
        if select:
            yield f"select = {_text(_named(select, first))}"
            yield "# settle_s = 0.1               # wait after choosing"
        yield "# discard = 1                  # if the first reading after choosing is old; `check` finds that"
    proposed = f"READ? {first}" if channels and not select else "READ?"
    question = ask(f"Question for a reading{f' of channel {first}' if channels else ''}", proposed)
    said = ask("Its answer, as the manual prints it", f"23.45 {unit}")
    scaled = _scale(ask, said, unit)
    yield f"reading = {{ ask = {_text(_named(question, first))}, answer = {_text(form_of(said))}{scaled} }}"
    yield "reading_s = 0.5"
    if channels:
        yield from ["", "[reader.channels]               # unit = ... in its braces if it has another one"]
        yield from (f'"{one}" = {{}}' for one in channels)


def _scale(ask: Ask, said: str, unit: str) -> str:
    """The scale of an answer whose number has no decimal point, as it stands in a file; "" for none."""
    found = _NUMBER.search(said)
    if found is None or "." in found[0] or not float(found[0]):
        return ""
    means = ask(f"Its number {found[0]} has no decimal point: how many {unit} is it", found[0])
    return "" if float(means) == float(found[0]) else f", scale = {float(means) / float(found[0]):.12g}"


def _named(command: str, channel: str) -> str:
    """A command for any channel, from that for one."""
    alone = rf"(?<![A-Za-z0-9]){re.escape(channel)}(?![A-Za-z0-9])"
    return re.sub(alone, "{channel}", command) if channel else command


def _registers(ask: Ask, role: str, unit: str) -> list[str]:
    number = ask("Register with a known number, such as its model code", "0")
    found = [
        "[identity]",
        f"register = {number}",
        f"is = {ask('That number', '1')}",
        "",
        f"[{role}]",
        f'unit = "{unit}"',
    ]
    places = ask("Register that says how many decimals a number has (empty: none)", "")
    scale = "" if places else ask("A register of 234 that means 23.4 has the scale", "0.1")
    tail = f", decimals = {places} }}" if places else f", scale = {scale} }}"
    if places:
        codes = ask("Decimals by what it holds, if that is a code, such as 0=3 1=2 (empty: the number itself)", "")
        known = ", ".join(f"{code} = {number}" for code, _, number in (one.partition("=") for one in codes.split()))
        tail = f", decimals = {places}, places = {{ {known} }} }}" if known else tail
    if role == "reader":
        channels = _places(ask, "registers", "inlet=1 outlet=3")
        if channels:
            return [*found, *_channels({name: f"{{ register = {one}{tail}" for name, one in channels.items()})]
        return [*found, f"reading = {{ register = {ask('Register of the reading', '1')}{tail}"]
    found += [f"low = {ask('Lowest setpoint', '0')}", f"high = {ask('Highest setpoint', '100')}"]
    setpoint = ask("Register of the setpoint", "2")
    found += [f"set = {{ register = {setpoint}{tail}", f"setpoint = {{ register = {setpoint}{tail}"]
    found.append(f"read = {{ register = {ask('Register of its reading', '1')}{tail}")
    found.append(f"safe_value = {ask('Setpoint of its safe state', '25')}")
    return [*found, "tolerance = 0.2", "dwell_s = 60"]


def _places(ask: Ask, what: str, such: str) -> dict[str, str]:
    """Channels and where each is; {} if it has one."""
    said = ask(f"Its channels and their {what}, such as {such} (empty: it has one)", "")
    return {name: place for name, _, place in (one.partition("=") for one in said.split())}


def _channels(readings: Mapping[str, str]) -> Iterator[str]:
    """Lines of channels that have a reading each."""
    yield from ["", "[reader.channels]               # unit = ... in its braces if it has another one"]
    yield from (f'"{name}" = {{ reading = {reading} }}' for name, reading in readings.items())


def _of_source(ask: Ask, asked: Sequence[tuple[str, str, str]]) -> Iterator[str]:
    """Lines of a source: key, question and proposal of each; and a safe setpoint where it is not switched off."""
    off = False
    for key, what, assumed in asked:
        if said := ask(what, assumed):
            off |= key == "off"
            yield f"{key} = {_text(said)}"
    if not off:
        yield f"safe_value = {ask('Setpoint of its safe state', '25')}"


def _messages(ask: Ask, role: str, unit: str) -> list[str]:
    found = ["[identity]                      # listened for before anything is sent"]
    found.append(f"ask = {_text(ask('Signal that tells it from others, MESSAGE.SIGNAL', 'Product.Type'))}")
    if said := ask("Its value, a number or a word of the DBC (empty: any)", ""):
        found.append(f"is = {said if _NUMBER.fullmatch(said) else _text(said)}")
    found += ["", f"[{role}]", f'unit = "{unit}"']
    if role == "reader":
        channels = _places(ask, "signals", "inlet=Readings.T1 outlet=Readings.T2")
        if channels:
            return [*found, *_channels({name: _text(one) for name, one in channels.items()})]
        return [*found, f"reading = {_text(ask('Signal of the reading', 'Readings.Temperature'))}"]
    found += [f"low = {ask('Lowest setpoint', '0')}", f"high = {ask('Highest setpoint', '100')}"]
    found.append(f"set = {_text(ask('Message with the setpoint', 'Command: Setpoint = {value}'))}")
    asked = (
        ("setpoint", "Signal of the setpoint", "State.Setpoint"),
        ("read", "Signal of its own reading", "State.Actual"),
        ("on", "Message that switches it on (empty: it is always on)", "Command: Enable = 1"),
        ("off", "Message that switches it off (empty: none)", "Command: Enable = 0"),
        ("output", "Signal that tells whether it is on (empty: none)", "State.Enabled"),
    )
    found += _of_source(ask, asked)
    return [*found, "tolerance = 0.1                 # near enough to its setpoint", "dwell_s = 60"]


def lacking(text: str) -> str:
    """Defects of the file, in words; "" if there are none."""
    try:
        parse(text)
    except ValueError as error:
        return str(error)
    return ""
