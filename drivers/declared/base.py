"""Common part of all declared instruments: identity, preparing, settings that are asked again."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.instrument import STAND_IN, Instrument
from rig.drivers.clock import Clock
from rig.drivers.declared.talk import Talk
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, DriverError, InstrumentError, Unreachable, WrongInstrument
from rig.drivers.roles import Identity
from rig.drivers.wires import Wires


class Setting(NamedTuple):
    """A setting of an instrument, read without a change.

    Attributes:
        asked: the question for it, or the command that no question asks for.
        found: its answer as printed; "" if it was not read.
        declared: the right answer by the file; "" if the file has none.
        why_not: why it was not read; "" if it was.
        same: whether its answer is the declared one.
    """

    asked: str
    found: str = ""
    declared: str = ""
    why_not: str = ""
    same: bool = False


class Declared:
    """An instrument of a file; its roles are in classes that inherit from this one.

    Args:
        name: the bench's name for it.
        address: its address.
        options: options in the bench file.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    table: ClassVar[Instrument]
    wire: ClassVar[Medium]
    shares: ClassVar[bool]
    coarse: ClassVar[bool]
    supplied: ClassVar[dict[str, Any]]
    own: ClassVar[bool] = False
    """Whether its file is a user's own, of which nobody else has seen how many lines an answer has."""
    speaks_unasked: ClassVar[bool] = True
    """Whether it may have said something on being switched on or connected, which is no answer."""
    contracts: ClassVar[tuple[ContractFile, ...]] = ()
    Options: ClassVar[type[BaseModel]]

    def __init__(self, name: str, address: str, options: Any, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._clock = clock
        self._options = options
        self._talk = self._opened(address, wires)
        try:
            self._hooks = self._talk.hooks = self.table.hooks
        except ValueError as error:
            self._talk.close()
            raise Unreachable(f"{name}: {error}") from None
        self._talk.watches = self.own
        self._where = self._talk.where
        self._prepared = False
        self._begin()

    def _opened(self, address: str, wires: Wires) -> Talk:
        """Open its wire."""
        self.table = self.table.chosen(vars(self._options))  # type: ignore[misc]  # of one instance
        return _talk(self.table, self.name, address, self._options, wires, self._clock)

    def _begin(self) -> None:
        """State of a role at the start."""

    def _give_up(self) -> None:
        """Give up what is under way."""

    def identify(self) -> Identity:
        """Ask for the identity, once it is silent. Nothing else is sent, but for the wire's preamble.

        Raises:
            WrongInstrument: it is another one.
            NoReply: it does not answer.
        """
        table, asked = self.table, self.table.identity
        assert asked is not None
        wanted = f"{table.maker} {' or '.join(table.model)}".strip()
        self._listen()
        try:
            found = self._talk.once(asked)
        except BadReply as error:
            try:
                found = self._talk.once(asked)
            except BadReply:
                raise WrongInstrument(f"{self._where} should be a {wanted}: {error}") from None
        fields = {"maker": table.maker, "model": table.model[0], "serial": "", "firmware": "", **found.fields}
        said = fields["model"].casefold()
        fields["model"] = next((one for one in table.model if one.casefold() == said), fields["model"])
        same = fields["model"] in table.model or table.any_model
        same = same and (not table.maker or f" {table.maker} ".casefold() in f" {fields['maker']} ".casefold())
        if asked.is_ is not None:
            same = same and self._talk.agree(found, asked.is_)
        echoed = bool(asked.ask) and (asked.ask or "").upper() in found.printed.upper()
        if not same or (echoed and str(asked.ask).endswith("?")):
            if echoed:
                raise WrongInstrument(
                    f"{self._where} echoes the command before its answer, {found.printed!r}: switch the echo off, "
                    f"at the instrument, the adapter or the serial server"
                )
            raise WrongInstrument(f"{self._where} should be a {wanted}; it answers {found.printed!r} to {asked.said!r}")
        return Identity(fields["maker"], fields["model"], fields["serial"], fields["firmware"])

    def _listen(self) -> None:
        if self.speaks_unasked:
            self._talk.clear()
        for command in self._talk.remote:
            self._talk.tell(command, checked=False)

    def prepare(self) -> None:
        """Send the commands that prepare it one by one, and read settings back.

        Raises:
            InstrumentError: a command was refused.
            BadReply: a setting reads back differently.
        """
        each, done = self.table.errors.each, self.table.wire.done
        self._talk.renew()
        self._talk.quiet = not self.table.prepare
        self._give_up()
        if each:
            self._talk.forget_errors()
        for command in (*self._talk.remote, *self.table.prepare):
            self._talk.tell(command, checked=each)
            if done is not None:  # so that none is sent while it is busy
                self._talk.ask(done)
        self._talk.quiet = True
        if not each:
            self._talk.raise_errors()
        for check in self.table.check:
            self._verify(check)
        self._ask_parameters()
        if self.table.mark is not None:
            for command in self.table.mark.tell:
                self._talk.tell(command, checked=each)
            self._verify(self.table.mark.check)
        self._prepared = True

    def _ask_parameters(self) -> None:
        """Ask for the parameters that it has itself."""

    def _verify(self, check: Check) -> None:
        if said := self._talk.right(check):
            raise BadReply(f"{self._where}: {said}, after it was prepared")

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: those of `check`, unless its panel is locked, `healthy`, `ready`."""
        kept = () if self._talk.remote else self.table.check
        return self._unlike((*kept, *self.table.healthy, *self.table.ready))

    def _unlike(self, checks: Sequence[Check]) -> tuple[str, ...]:
        return tuple(said for check in checks if (said := self._talk.right(check)))

    def compared(self) -> Sequence[Setting]:
        """All settings of its file as they are, by questions alone: `check`, `healthy`, and registers that are written.

        Raises:
            InstrumentError: a question of `healthy` has an error as its answer.
        """
        found = [self._setting(check) for check in self.table.check]
        for command in self.table.prepare:
            if any(_asks_for(check, command) for check in self.table.check):
                continue
            if command.register_ is not None and command.value is not None:
                same = {key: getattr(command, key) for key in ("register_", "table", "type")}
                found.append(self._setting(Check(**same, is_=command.value)))
            else:
                found.append(Setting(command.said, why_not="no question of `check` asks for it"))
        return (*found, *(self._setting(one, refusing=True) for one in (*self.table.healthy, *self.table.ready)))

    def _setting(self, check: Check, *, refusing: bool = False) -> Setting:
        declared = f"{check.is_:g}" if isinstance(check.is_, float) else check.is_
        try:
            for _ in range(2):
                found = self._talk.ask(check)
                if same := self._talk.agree(found, check.is_):
                    break
        except DriverError as error:
            if refusing and isinstance(error, InstrumentError):
                raise
            return Setting(check.said, declared=declared, why_not=str(error))
        return Setting(check.said, self._talk.told(check, found), declared, same=same)

    def unwatched(self) -> Sequence[str]:
        """What nothing in its file would show, in words."""
        table, reader, source = self.table, self.table.reader, self.table.source
        asked = table.lines and table.wire.protocol != "stream"
        unread = [one for one in table.prepare if not any(_asks_for(check, one) for check in table.check)]
        found = {
            "whether a command was refused (errors)": asked and table.errors.ask is None and not table.errors.replies,
            f"what {', '.join(one.said for one in unread)} set (check)": bool(unread),
            "a setting that is changed at its panel (check)": not table.check and not table.healthy,
            "that its power was off (mark)": not table.remembers,
            "its setpoint (source.setpoint)": source is not None and source.setpoint is None,
            "whether it is on (source.output)": source is not None and bool(source.on) and source.output is None,
            "an answer to an earlier question for a reading (reader.number, reader.confirm)": asked
            and reader is not None
            and not reader.number
            and reader.confirm is None
            and "{mark" not in "".join(command.said for command in reader.start),
        }
        return tuple(what for what, so in found.items() if so)

    def without_point(self) -> Sequence[str]:
        """Numbers without a decimal point that were read last, beside what they were taken for, in words."""
        told = []
        for place, ask in self.table.asks():
            wanted = place.endswith(".reading") or place in ("source.setpoint", "source.read")
            printed, value = self._talk.printed.get(id(ask), (".", 0.0)) if wanted else (".", 0.0)
            plain = ask.decimals is None and ask.scale == 1.0
            if plain and set(printed) & set(".,"):
                continue
            how = "by its decimals" if ask.decimals is not None else "by its scale"
            how = "since neither scale nor decimals is declared" if plain else how
            told.append(f"{ask.said}: {printed} is taken for {value:g}, {how}")
        return told

    def _lost(self) -> bool:
        """Whether its power has been off since it was prepared; False if nothing tells."""
        mark = self.table.mark
        if mark is not None:
            found = self._talk.ask(mark.check)
            return not self._talk.agree(found, mark.check.is_)
        return self.table.remembers and bool(self._unlike(self.table.check))

    def remarks(self) -> Sequence[str]:
        """Said of a stand-in: that it is one; of a bridge, that nothing says who should be behind it."""
        if self.table.any_model:
            return ("the bench file does not say which instrument it should be: write its maker and model",)
        if self.table.about != STAND_IN:
            return ()
        return ("has no twin: a stand-in of its role answers, whose lines are not those of the instrument",)

    def make_safe(self) -> None:
        """The safe state of its roles."""

    def close(self) -> None:
        """Give the panel back if it was prepared, and release the wire; idempotent."""
        if self._prepared and self.table.local:
            self._prepared = False
            with contextlib.suppress(DriverError):
                for command in self.table.local:
                    self._talk.tell(command, checked=False)
        self._talk.close()


class Remembering(Declared):
    """One that is known to have been off (`rig.drivers.roles.Restartable`)."""

    def restarted(self) -> bool:
        """Whether it has been powered up since `prepare` last ran."""
        return self._lost()


def _asks_for(check: Ask, command: Tell) -> bool:
    """Whether a question asks for what a command sets, by its register, or its first word and what it names."""
    if command.register_ is not None or command.tell is None:
        groups = (("coil", "discrete"), ("holding", "input"))  # bits, and words, may be read by another function
        return check.register_ == command.register_ and any({check.table, command.table} <= set(one) for one in groups)
    first, (asked, *named) = command.tell.replace("=", " ").split()[:1], (check.ask or "").split() or [""]
    same = [part.strip(":").casefold() for part in first] == [asked.strip(":?").casefold()]
    return same and all(one in command.tell for one in named)


def _talk(table: Instrument, name: str, address: str, options: Any, wires: Wires, clock: Clock) -> Talk:
    if table.modbus:
        from rig.drivers.declared.modbus import ModbusTalk  # noqa: PLC0415 - few benches have one

        return ModbusTalk(table, name, address, wires, clock)
    parameters = table.parameters
    if table.can:
        from rig.drivers.declared.can import CanTalk  # noqa: PLC0415

        return CanTalk(table, name, address, parameters, wires, clock)
    if table.bridge:
        from rig.drivers.declared.bridged import BridgedTalk  # noqa: PLC0415

        return BridgedTalk(table, name, address, parameters, wires, clock)
    from rig.drivers.declared.text import TextTalk  # noqa: PLC0415

    return TextTalk(table, name, address, options.settings(address), parameters, wires, clock)
