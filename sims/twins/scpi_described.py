"""Twins of SCPI instruments that a bench file describes.

Such a twin knows the headers of its prepare lines, written as they are there, and keeps their parameters until *RST or
power-off. A question about one of them answers what was set, if that is a number or a switch. Any other setting that
the bench file reads back has its wanted value once all prepare lines have come. Everything else is an undefined header.
The twin shows whether a bench file is consistent. Whether it is right shows the instrument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar

from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.instrument import Instrument
from rig.sims.declared.behaviour import Behaviour, Refused, Said
from rig.sims.declared.lines import ENDS
from rig.sims.identity import fitting
from rig.sims.twins.scpi import COMMON, ScpiTwin, Wait
from rig.sims.twins.scpi_syntax import Command, ScpiError, compiled, number, split_outside
from rig.sims.world import World

_STATUS = compiled(tuple(row for row in COMMON if row.header not in ("SYSTem:REMote", "SYSTem:RWLock", "SYSTem:LOCal")))
_QUESTIONS = {"fetch": "reader", "setpoint": "source", "read": "source", "output": "source", "settled": "source"}
"""Options with a question, which may be compound, `:FETC?;:STAT?`, and the role that it belongs to."""
_COMMANDS = {"start": "reader", "abort": "reader", "set": "source", "on": "source", "off": "source"}
"""Options with a command, likewise; that of `start` may have several units."""
_ASK, _TELL = Ask(ask=""), Tell(tell="")  # of a number that needs no form
_SWITCH = {"ON": "1", "OFF": "0"}


def header(line: str) -> str:
    """The header of a line as a twin knows it: that of its one unit, or of all units of a compound question."""
    return ";".join(name for name, _ in units(line))


@lru_cache(maxsize=4096)
def units(line: str) -> tuple[tuple[str, str], ...]:
    """Headers of a line, each with its whole path in upper case and its question mark, and their parameters."""
    found, path = [], ""
    for unit in split_outside(line, ";"):
        header, _, rest = unit.strip().partition(" ")
        name = header.upper()
        if not name.startswith("*"):
            name = name[1:] if name.startswith(":") else path + name
            path = name[: name.rfind(":") + 1]
        found.append((name, rest.strip()))
    return tuple(found)


class DescribedTwin(ScpiTwin):
    """An instrument with the commands of its bench file; always in remote control.

    Args:
        name: the bench's name for it.
        options: its options in the bench file.
        world: virtual time.
        plant: a `rig.sims.physics.Plant`.
        serial: its serial number.

    Attributes:
        it: what it does and reads, as a declared instrument.
    """

    commands: ClassVar[Mapping[str, Command]] = _STATUS

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        table = Instrument.model_construct(**self.role(options))
        self.it: Behaviour = type("It", (Behaviour,), {"table": table})(name, options, world, plant, serial)
        self.options, self.inputs, self.quantity = options, self.it.inputs, self.it.quantity
        self._serial = serial
        self.line_end = ENDS[str(options.get("line_end", "lf"))]
        self._prepare = [unit for line in _texts(options, "prepare") for unit in units(line)]
        check = options.get("check", {})
        assert isinstance(check, Mapping)
        self._check = {header(str(question)): str(answer) for question, answer in check.items()}
        healthy = options.get("healthy") or {}
        assert isinstance(healthy, Mapping)
        self._healthy = {header(str(question)): str(answer) for question, answer in healthy.items()}
        questions = {key: str(options.get(key) or "") for key in _QUESTIONS}
        self._asks = {header(text): key for key, text in questions.items() if text}
        self._tells = [(key, *one) for key in _COMMANDS for one in units(str(options.get(key) or "")) if one[0]]
        self._bit = int(str(options.get("settled_bit", 0)))
        asked = [*questions.values(), *(str(q) for q in (*check, *healthy))]
        self._compound = {header(question) for question in asked if len(units(question)) > 1}
        self._error = units(str(options.get("error", "SYST:ERR?")))[0][0]
        super().__init__(name, world, int(str(options.get("baud", 9600))), str(options.get("frame", "8N1")))

    def role(self, options: Mapping[str, object]) -> dict[str, Any]:
        """Its reader or source, as a table has it."""
        raise NotImplementedError(f"{type(self).__name__} has no role")

    def reset(self) -> None:
        """*RST: settings are forgotten, and what it does ends."""
        self.it.power_cycle()
        self._count = 1
        self._kept: dict[str, str] = {}
        self._came: set[str] = set()

    def switch_on(self) -> None:
        """As after *RST, in remote control."""
        super().switch_on()
        self.remote = True

    def ask_identity(self) -> str:
        """*IDN?."""
        pattern = str(self.options.get("identity") or "")
        if pattern and (found := fitting(pattern, self._serial)) is not None:
            return found
        model = str(self.options.get("model") or "SIMULATED")
        return f"{self.options.get('maker') or 'SIMULATED'},{model},{self._serial},1.0"

    def number(self, *texts: str) -> str:
        """An answer with numbers, in the form of the bench file: all in one part of a compound answer."""
        parts = str(self.options.get("number", "{number}")).split(";")
        filled = (",".join(part.replace("{number}", text) for text in texts if part) for part in parts)
        return ";".join(f if "{number}" in p else p for p, f in zip(parts, filled, strict=True)).replace("*", "0")

    def commands_in(self, line: str) -> Sequence[tuple[str, str]]:
        """The commands of a line, in order; a compound question of the bench file is one command."""
        plain, given = super().commands_in(line), units(line)
        for at in range(len(given)):
            for count in range(2, len(given) - at + 1):
                name = ";".join(one for one, _ in given[at : at + count])
                if name in self._compound:
                    return (*plain[:at], (name, ""), *plain[at + count :])
        return plain

    def busy_for(self) -> float:
        """Seconds until all readings are taken."""
        return self.it.busy_for()

    def does(self, name: str, rest: str) -> str | None:
        """Execute a header of its own; the answer if it is a question. Raises `KeyError` if there is none.

        Args:
            name: with its path, in upper case.
            rest: its parameters.
        """
        for at, (key, known, template) in enumerate(self._tells):
            if name == known and not name.startswith("*") and (holes := _holes(template, rest)) is not None:
                if key != "start":
                    self.done(f"{_COMMANDS[key]}.{key}", **holes)
                else:
                    self._started(holes, last=all(other != "start" for other, *_ in self._tells[at + 1 :]))
                return None
        key = self._asks.get(name, "")
        if key == "fetch":
            return self._fetched() if self._tells and self._tells[0][0] == "start" else self._one()
        if key in ("setpoint", "read"):
            return self.number(f"{self.told(f'source.{key}').value:.9E}")
        if key:
            return str(int(self.told(f"source.{key}").value) << (self._bit if key == "settled" else 0))
        return self._healthy[name]

    def _started(self, holes: Mapping[str, float], *, last: bool) -> None:
        """Take the number of readings; the last unit of `start` begins them."""
        count = round(holes.get("count", self._count))
        if not 1 <= count <= self.it.most:
            raise ScpiError(-222)
        self._count = count
        if last and self.busy_for() > 0:
            raise ScpiError(-213)
        if last:
            self.done("reader.start", count=float(count))

    def _fetched(self) -> str:
        if not self.it.begun:
            raise ScpiError(-230)
        said = self.told("reader.fetch")  # readings are kept until the next start
        if said.after_s > 0:
            raise Wait(said.after_s)
        readings: Any = said.fields["values"]
        return self.number(*(f"{one:+.9E}" for one in readings))

    def _one(self) -> str:
        """A reading that is taken by its question."""
        if not self.it.begun:
            self.done("reader.start", count=1.0)
        found = self._fetched()
        self.done("reader.abort")
        return found

    def done(self, place: str, **holes: float) -> None:
        """Carry out what a command of the table does. Raises `ScpiError` where the table does not allow it."""
        try:
            self.it.does(place, _TELL, holes)
        except Refused:
            raise ScpiError(-222) from None

    def told(self, place: str) -> Said:
        """Contents of the answer to a question of the table."""
        return self.it.answers(place, _ASK, {})

    def _execute(self, path: str, header: str, rest: str) -> tuple[str, str | None]:
        if not header:
            return path, None
        if header in self._compound:
            name = header
        else:
            ((name, _),) = units(header if header.startswith(("*", ":")) else f":{path}{header}")
        own = path if name.startswith("*") or name in self._compound else name[: name.rfind(":") + 1]
        if name == self._error and name != "*ESR?":
            return own, self.ask_error()
        try:
            return own, self._completed(name, self.does(name, rest))
        except KeyError:
            pass
        if name.removesuffix("?") in self.commands:
            return super()._execute(path, header, rest)
        return own, self._setting(name, rest)

    def _completed(self, name: str, answer: str | None) -> str | None:
        """An answer with one part for each unit of a compound question: 0 where the form of answers says nothing."""
        lacking = name.count(";") - (answer or "").count(";") if name in self._compound else 0
        return answer if answer is None else answer + ";0" * lacking

    def _setting(self, name: str, rest: str) -> str | None:
        """A setting of the prepare lines, or a question about one."""
        if name.endswith("?"):
            return self._recalled(name)
        if all(name != known for known, _ in self._prepare):
            raise ScpiError(-113)
        self._kept[name] = rest
        self._came.add(name)
        return None

    def _recalled(self, name: str) -> str:
        """A number or a switch as it was set; another setting as wanted, since instruments print texts differently."""
        kept = _SWITCH.get(self._kept.get(name.removesuffix("?"), "").upper(), self._kept.get(name.removesuffix("?")))
        if kept is not None and (name not in self._check or _is_number(kept)):
            return kept
        if name in self._check:
            return self._check[name] if self._prepared() else "0"
        if any(name == f"{known}?" for known, _ in self._prepare):
            return "0"
        raise ScpiError(-113)

    def _prepared(self) -> bool:
        return all(name in self._came for name, _ in self._prepare if not name.startswith("*"))


def _holes(template: str, rest: str) -> dict[str, float] | None:
    """The number in the parameters of a command; {} if there is none, None if they are others. Raises `ScpiError`."""
    for hole in ("count", "value"):
        before, found, after = template.partition(f"{{{hole}}}")
        if found and rest.startswith(before) and rest.endswith(after):
            return {hole: number(rest.removeprefix(before).removesuffix(after))}
    return {} if rest == template else None


def _is_number(text: str) -> bool:
    try:
        number(text)
    except ScpiError:
        return False
    return True


def _texts(options: Mapping[str, object], key: str) -> list[str]:
    found = options.get(key) or ()
    assert isinstance(found, list | tuple)
    return [str(text) for text in found]
